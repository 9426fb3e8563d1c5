"""The rows of stable intervals with passive hands, a passive port, two of them, or a passive channel."""

from wavesweep.core.tables.row_kinds import RowKind

_EVERY = "stable with every passive hand"
_PORT = "hand's port passive, forces held over a tick"
ROWS = {
    "passive": RowKind(_EVERY, "every passive hand", "#009E73", 3, nowhere=f"nowhere {_EVERY}"),
    "port": RowKind(_PORT, "passive port", "#CC79A7", 5, "passive", "nowhere passive", of_operator=True),
    "ports": RowKind(
        "absolutely stable at both ports",
        "absolutely stable",
        "#000000",
        4,
        "absolutely stable",
        "nowhere absolutely stable",
    ),
    "channel": RowKind(
        "wave channel passive to within the tolerance", "passive wave channel", "#E69F00", 4, "passive", "nowhere passive"
    ),
}
