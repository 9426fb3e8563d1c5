"""The slices that a spec asks for, computed in chunks on workers."""
