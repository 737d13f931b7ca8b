"""Landmarks far away sleep: the filter's state stays small however large the home.

A group that falls asleep leaves the state, but not without a trace. Given some landmarks that stay
awake, the anchors a, the group b is Gaussian:

    b = b0 + G (a - a0) + e,    G = P_ba P_aa^-1,    cov(e) = C = P_bb - G P_ab.

While the group sleeps nothing measures it, so that p(b | a) does not change, whatever happens to
the anchors: a correction (a loop that closes) moves the group along with them when it wakes, with
covariance G P_aa G^T + C and cross-covariance G P_a. with all of the state. Within the group, and
between group and anchors, that is the exact EKF. Neglected is only what group and the rest of the
state have in common beyond the anchors. Of all joint Gaussians with the same covariance of group
and anchors and of anchors and rest, this is the one of largest entropy (Dempster, "Covariance
selection", Biometrics 1972): nothing is made up. It is the approximation of thin junction trees
(Paskin, IJCAI 2003) and of conditionally independent submaps (Pinies and Tardos, IEEE Trans.
Robotics 2008), with the anchors as the only separator, so that one step wakes any group.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from robot.slam.catalogue import Entry
from robot.slam.ekf import FIRST_LANDMARK, POSE, LandmarkFilter

GROUP = 16  # landmarks that fall asleep and wake together
_ANCHORS, _ANCHOR_EVERY_M = 40, 2.0
_AWAY_M = 2.0  # nearer than this nothing falls asleep
_WAKE_M = 4.0
_NEARER_M = 1.0  # a group wakes at the cost of others that are so much farther


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """m landmarks asleep, given k anchors by `Entry`."""

    entries: list[Entry]
    anchors: list[Entry]
    place: np.ndarray  # (2 m,) when they fell asleep
    anchor_place: np.ndarray  # (2 k,) at the same time
    gain: np.ndarray  # (2 m, 2 k), G
    own: np.ndarray  # (2 m, 2 m), C
    centre: np.ndarray  # (2,) middle of the group where it fell asleep; it moves by drift only


def state_entries(landmarks: np.ndarray) -> np.ndarray:
    """The entries (2 m,) of the filter's state that are the landmarks (m,)."""
    return (FIRST_LANDMARK + 2 * landmarks[:, None] + np.arange(2)).reshape(-1)


def put_to_sleep(ekf: LandmarkFilter, entries: list[Entry], anchors: list[Entry]) -> Group:
    """What is to be remembered of `entries` given `anchors`; the filter stays as it is."""
    b = state_entries(np.array([entry.index for entry in entries], dtype=int))
    a = state_entries(np.array([entry.index for entry in anchors], dtype=int))
    cov = ekf.P
    across = cov[np.ix_(b, a)]
    gain = np.linalg.solve(cov[np.ix_(a, a)], across.T).T if len(a) else across
    own = cov[np.ix_(b, b)] - gain @ across.T
    own = 0.5 * (own + own.T)
    centre = ekf.x[b].reshape(-1, 2).mean(axis=0)
    return Group(list(entries), list(anchors), ekf.x[b], ekf.x[a], gain, own, centre)


def wake_up(ekf: LandmarkFilter, group: Group) -> None:
    """Append the group to the filter, where its anchors now say that it is."""
    a = state_entries(np.array([entry.index for entry in group.anchors], dtype=int))
    cov = ekf.P
    moved = group.gain @ (ekf.x[a] - group.anchor_place)
    cross = group.gain @ cov[a]
    corner = cross[:, a] @ group.gain.T + group.own
    ekf.append((group.place + moved).reshape(-1, 2), cross, corner)


@dataclass(slots=True, eq=False)
class Sleepers:
    """All groups that sleep, and who goes next."""

    groups: list[Group] = field(default_factory=list)

    def put_away(
        self, ekf: LandmarkFilter, entries: list[Entry], free: np.ndarray, surplus: int
    ) -> np.ndarray:
        """Put at least `surplus` of the landmarks to sleep, the farthest first, in groups.

        Only those of the mask `free` (n,) may. Returns which (n,) the filter must now drop.
        """
        places = ekf.landmarks()
        away_m = np.hypot(*(places - ekf.x[POSE][:2]).T)
        gone = np.zeros(len(entries), dtype=bool)
        while surplus > gone.sum():
            left = free & ~gone & (away_m > _AWAY_M)
            left &= ~np.array([entry.anchor for entry in entries])
            if not left.any():
                break
            index = np.flatnonzero(left)
            farthest = index[np.argmax(away_m[index])]
            near = np.hypot(*(places[index] - places[farthest]).T)
            chosen = index[np.argsort(near, kind="stable")[: GROUP + 1]].tolist()
            self._promote(entries, places, chosen)
            chosen = [i for i in chosen if not entries[i].anchor][:GROUP]
            anchors = [entry for entry in entries if entry.anchor]
            if chosen:
                self.groups.append(put_to_sleep(ekf, [entries[i] for i in chosen], anchors))
                gone[chosen] = True
        return gone

    @staticmethod
    def _promote(entries: list[Entry], places: np.ndarray, chosen: list[int]) -> None:
        """Leave the best of the group behind as an anchor where none is near."""
        anchors = np.flatnonzero([entry.anchor for entry in entries])
        middle = places[chosen].mean(axis=0)
        near = np.hypot(*(places[anchors] - middle).T)
        if len(anchors) < _ANCHORS and (near > _ANCHOR_EVERY_M).all():
            best = max(chosen, key=lambda i: (entries[i].visits, entries[i].sightings, -i))
            entries[best].anchor = True

    def wake(self, ekf: LandmarkFilter, entries: list[Entry], room: int) -> list[Entry]:
        """Wake the nearest group, where it is near and there is room; returns its entries."""
        if not self.groups:
            return []
        here = ekf.x[POSE][:2]
        away_m = np.hypot(*(np.array([group.centre for group in self.groups]) - here).T)
        nearest = int(np.argmin(away_m))
        if away_m[nearest] > _WAKE_M:
            return []
        if room < GROUP:
            free = ~np.array([entry.anchor for entry in entries])
            others = np.hypot(*(ekf.landmarks() - here).T)[free]
            if (others > away_m[nearest] + _NEARER_M).sum() < GROUP:
                return []
        group = self.groups.pop(nearest)
        wake_up(ekf, group)
        return group.entries

    def forget(self, alive: list[Entry], born_after_ns: int) -> None:
        """Drop the groups with members born later, or with an anchor that is no more."""
        there = set(map(id, alive))
        self.groups = [
            group
            for group in self.groups
            if all(entry.born_ns <= born_after_ns for entry in group.entries)
            and all(id(anchor) in there for anchor in group.anchors)
        ]

    def whole(
        self, ekf: LandmarkFilter, entries: list[Entry]
    ) -> tuple[LandmarkFilter, list[Entry]]:
        """A copy of the filter with all awake, and the entries in its order."""
        everything, known = ekf.clone(), list(entries)
        for group in self.groups:
            wake_up(everything, group)
            known += group.entries
        return everything, known
