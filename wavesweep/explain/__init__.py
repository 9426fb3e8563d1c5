"""`explain`: words of the program, and what to do about them."""
