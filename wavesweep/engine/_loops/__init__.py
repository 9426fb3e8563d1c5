"""One multirate loop: blocks that run every so many ticks and their wires."""
