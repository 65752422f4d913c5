"""An emulated UR controller: what an RTDE client sees of a real one, on a loopback address."""
