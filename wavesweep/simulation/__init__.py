"""Every loop run tick by tick: the paper's experiment in simulation, and a witness against every
other analysis.

It shares nothing with the engine's blocks and frames. A drawing says which blocks there
are, when they run and how they are wired; what each type of block does is written here a second
time (`laws`), so that an error in a block or in a frame shows as a difference between two programs
and not as the same mistake twice. A test reads the imports and keeps it so.

`running_blocks` turns a drawing into laws and sums, `tick_sums` orders them into a program per kind of tick,
`march` runs these with the effects of `hardware`; `body` moves the device, `inputs` has the forces
of the hand, `record` the results.
"""
