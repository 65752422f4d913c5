"""Real devices behind the ports of `core.ports`; vendor errors and units stop here."""
