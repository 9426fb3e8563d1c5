"""A wall that pushes and never pulls: motions that come to rest though contact is lost and made."""
