"""The frame of a multirate loop: its blocks connected in each tick, the product of the ticks,
and cuts at numbers."""
