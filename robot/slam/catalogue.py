"""What is known of a landmark besides its place: kind, height, signatures, sightings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from robot.messages import Landmark
from robot.slam.sensor import sights_of

BITS = 256
_KINDS = {"point": 0, "edge": 1}
AWAY_NS = 2_000_000_000  # a landmark unseen for longer was out of view
_MAX_SIGNATURES = 5
_NEW_SIGNATURE_BITS = 20  # a view that differs by less teaches nothing
_BEHIND = -0.2  # cosine: no face is seen from its back; what is seen from all around has none


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """The landmarks of one frame as arrays; bits are -1 and 1, so that a product counts them."""

    sight: np.ndarray  # (m, 2): inverse range 1/m, bearing rad
    cov: np.ndarray  # (m, 2, 2) of the sight
    range_m: np.ndarray  # (m,)
    kind: np.ndarray  # (m,)
    height_m: np.ndarray  # (m,), NaN unknown
    track: np.ndarray  # (m,), -1 not followed
    bits: np.ndarray  # (m, 256) float32

    def __len__(self) -> int:
        return len(self.range_m)


def collect(
    landmarks: Sequence[Landmark], range_factor: float = 1.0, bearing_factor: float = 1.0
) -> Observations:
    """Arrays of the points and edges among `landmarks`, with variances times the factors."""
    used = [
        seen
        for seen in landmarks
        if seen.kind in _KINDS and seen.range_m > 0.0 and len(seen.signature) == BITS // 8
    ]
    raw = np.frombuffer(b"".join(seen.signature for seen in used), dtype=np.uint8)
    bits = np.unpackbits(raw.reshape(len(used), BITS // 8), axis=1).astype(np.float32)
    polar = np.array([(seen.range_m, seen.bearing_rad) for seen in used]).reshape(-1, 2)
    cov = np.array([seen.cov for seen in used]).reshape(-1, 2, 2)
    factors = np.array([range_factor, bearing_factor])
    sight, sight_cov = sights_of(polar, cov)
    return Observations(
        sight,
        sight_cov * np.sqrt(np.outer(factors, factors)),
        polar[:, 0],
        np.array([_KINDS[seen.kind] for seen in used], dtype=int),
        np.array([seen.height_m for seen in used]),
        np.array([seen.track_id for seen in used], dtype=int),
        2.0 * bits - 1.0,
    )


@dataclass(slots=True, eq=False)
class Entry:
    """One landmark of the filter; `index` is its place there."""

    index: int
    kind: int
    height_m: float
    bits: list[np.ndarray]
    sightings: int
    visits: int  # times it was found again by its signature
    born_ns: int
    last_seen_ns: int
    along: np.ndarray = field(default_factory=lambda: np.full(2, np.nan))  # mean unit line of sight
    refused: int = 0  # sightings in a row that did not fit
    anchor: bool = False  # groups that sleep are known relative to it

    def learn(self, bits: np.ndarray, height_m: float, along: np.ndarray, t_ns: int) -> None:
        """Take in a sighting that fitted, `along` (2,) in `world`."""
        self.sightings += 1
        self.last_seen_ns = t_ns
        self.refused = 0
        weight = 1.0 / min(self.sightings, 50)
        known = np.isfinite(self.along[0])
        self.along = self.along + weight * (along - self.along) if known else along
        if np.isfinite(height_m):
            known = np.isfinite(self.height_m)
            self.height_m = (
                self.height_m + weight * (height_m - self.height_m) if known else height_m
            )
        if len(self.bits) < _MAX_SIGNATURES and all(
            BITS - bits @ known_bits > 2 * _NEW_SIGNATURE_BITS for known_bits in self.bits
        ):
            self.bits.append(bits)

    def absorb(self, other: Entry) -> None:
        """Take over what is known of `other`, which is the same thing."""
        self.sightings += other.sightings
        self.visits += 1
        self.last_seen_ns = max(self.last_seen_ns, other.last_seen_ns)
        self.bits += other.bits[: _MAX_SIGNATURES - len(self.bits)]


@dataclass(slots=True, eq=False)
class Catalogue:
    """Entries in the filter's order, and which track shows which entry."""

    entries: list[Entry] = field(default_factory=list)
    by_track: dict[int, Entry] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.entries)

    def add(
        self,
        kind: int,
        height_m: float,
        bits: np.ndarray,
        along: np.ndarray,
        track: int,
        t_ns: int,
    ) -> None:
        """Append the entry of a landmark that was appended to the filter."""
        entry = Entry(len(self.entries), kind, height_m, [bits], 1, 1, t_ns, t_ns, along)
        self.entries.append(entry)
        if track >= 0:
            self.by_track[track] = entry

    def extend(self, entries: list[Entry]) -> None:
        """Append the entries of landmarks that were appended to the filter again."""
        for index, entry in enumerate(entries, start=len(self.entries)):
            entry.index = index
        self.entries += entries

    def keep(self, kept: np.ndarray) -> None:
        """Forget all entries but `kept`, as the filter did."""
        self.entries = [self.entries[int(i)] for i in kept]
        alive = set(map(id, self.entries))
        for index, entry in enumerate(self.entries):
            entry.index = index
        self.by_track = {t: e for t, e in self.by_track.items() if id(e) in alive}

    def forget_tracks(self, present: np.ndarray) -> None:
        """Drop the tracks that are not followed any more; their numbers never come back."""
        alive = set(present.tolist())
        self.by_track = {t: e for t, e in self.by_track.items() if t in alive}

    def join(self, older: Entry, younger: Entry) -> None:
        """Let the tracks that show `younger` show `older`, and that know what both do."""
        older.absorb(younger)
        self.by_track = {t: older if e is younger else e for t, e in self.by_track.items()}

    def bound(self, track: np.ndarray) -> np.ndarray:
        """Landmark index (m,) of each track, -1 where it is not known."""
        found = (self.by_track.get(t) for t in track.tolist())
        return np.array([-1 if entry is None else entry.index for entry in found], dtype=int)

    def looseness_m(self, t_ns: int, view_sigma_m: float) -> np.ndarray:
        """By how much (n,) each landmark may look shifted: zero while it stays in view.

        From another side, a corner of a texture or of a thing is not quite the same point.
        """
        last = np.array([entry.last_seen_ns for entry in self.entries], dtype=np.int64)
        return np.where(t_ns - last > AWAY_NS, view_sigma_m, 0.0)

    def familiar(self, t_ns: int, age_ns: int) -> int:
        """How many of the landmarks seen at `t_ns` were known `age_ns` before."""
        return sum(e.last_seen_ns == t_ns and t_ns - e.born_ns > age_ns for e in self.entries)

    def kinds(self) -> np.ndarray:
        """Kind (n,) of each landmark."""
        return np.array([entry.kind for entry in self.entries], dtype=int)

    def heights_m(self) -> np.ndarray:
        """Height (n,) of each landmark, NaN unknown."""
        return np.array([entry.height_m for entry in self.entries], dtype=float)

    def facing(self, along: np.ndarray) -> np.ndarray:
        """Whether who looks `along` (m, 2) may see each landmark, (m, n): not from its back."""
        known = np.array([entry.along for entry in self.entries]).reshape(-1, 2)
        return ~(along @ known.T < _BEHIND)  # an unknown side excludes nothing

    def hamming(self, bits: np.ndarray, among: np.ndarray) -> np.ndarray:
        """Smallest Hamming distances (m, k) of signatures (m, 256) to the k landmarks `among`."""
        chosen = [self.entries[int(i)].bits for i in among]
        bank = np.array([view for views in chosen for view in views])
        first = np.cumsum([0, *(len(views) for views in chosen[:-1])])
        return 0.5 * (BITS - np.maximum.reduceat(bits @ bank.T, first, axis=1))
