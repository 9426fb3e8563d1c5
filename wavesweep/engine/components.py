"""Strongly connected components of what acts on what."""

import numpy as np


def strong_components(acts: np.ndarray) -> list[list[int]]:
    """The components of a pattern `(n, n)`, whose entry (i, j) says that j acts on i: each as
    indices in order, after all that act on it.

    A walk from a state to those that act on it, and on from these. The states of the walk that are
    not known to be in different components are a row of parts, which `starts` has the first state
    of: a state that is met again joins all parts behind it (H. N. Gabow, Inf. Proc. Lett. 74,
    2000).
    """
    n = len(acts)
    acted_on, acting = np.nonzero(acts)
    ends = np.searchsorted(acted_on, np.arange(1, n))
    successors = [iter(states.tolist()) for states in np.split(acting, ends)]
    number: dict[int, int] = {}
    walked: list[int] = []
    starts: list[int] = []
    done: set[int] = set()
    components = []
    for start in range(n):
        way = [] if start in number else [start]
        while way:
            state = way[-1]
            if state not in number:
                number[state] = len(number)
                walked.append(state)
                starts.append(state)
            new = None
            for before in successors[state]:
                if before not in number:
                    new = before
                    break
                while before not in done and number[starts[-1]] > number[before]:
                    starts.pop()
            if new is not None:
                way.append(new)
                continue
            way.pop()
            if starts[-1] == state:
                starts.pop()
                component: list[int] = []
                while state not in component[-1:]:
                    component.append(walked.pop())
                components.append(sorted(component))
                done.update(component)
    return components
