"""What every floor above speaks: geometry, optics, kinematics, documents, ports, errors."""
