"""The language of drawings: blocks, wires and ports, and expressions in numbers and signals."""
