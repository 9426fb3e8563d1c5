"""Search for designs that meet a wish; each design is evaluated over everything that it has to
hold for, in batches."""
