"""`inspect`: what a table has."""
