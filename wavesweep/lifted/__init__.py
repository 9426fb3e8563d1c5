"""Conversion of a multirate diagram to one unirate system: discretise, connect, lift."""
