"""One multirate loop: blocks that run every so many ticks and their wires, and the paper's controllers drawn with them."""
