"""The columns of the table `margins`."""

from wavesweep.program.tables.fields import columns_beside

_VALUES = {
    "margin": {
        "gain_up": "the loop stays stable if the signal is multiplied by up to this factor; 1e6 means: by any",
        "gain_down": "the loop stays stable if the signal is multiplied by down to this factor; 0 means: by any",
        "phase": "phase (deg) that the signal may lose or gain; 180 means: any",
        "delay": "dead time (s) behind the signal up to which the loop stays stable, of any fraction of a tick",
        "delay_frames": "the loop stays stable if the signal is late by fewer whole frames; 1e6 means: by any; in place of delay "
        "where the signal is read by other blocks than plants, or no limit is near",
        "disk": "the largest a for which every factor (1 + a d/2)/(1 - a d/2), |d| < 1, leaves the loop stable",
        "disk_gain": "how far the gain alone may move within the disk, up or down by this factor; 1e6 means: by any",
        "disk_phase": "how far the phase (deg) alone may move within the disk",
        "sensitivity": "Ms, the largest factor by which a disturbance is amplified; usual designs have less than 2",
        "complementary": "Mt, the largest factor by which a command is amplified; usual designs have less than 1.5",
    },
}
COLUMNS = columns_beside(__file__, _VALUES)
