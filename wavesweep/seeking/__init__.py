"""Designs that meet a wish: evaluated in batches over all that they have to hold for, and searched for."""
