"""Recordings made harder on purpose: `--perturb mirror,relabel,shift=0.1,drop=0.3,...`.

mirror        left and right change places, in orders, sights and truth
relabel       every thing gets another number
shift=S       sights are stamped S seconds late
drop=P        a share P of the sights is lost
outliers=P    a share P of the ranges is anything between a tenth and three times the truth
wrong=P       a share P of the sights carries the name of another thing
slip=P        for 3 s in every 60 the wheels go on but the base moves a share P less
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robot.bench.slam.data import SurveyData
from robot.errors import DataError

KINDS = ("mirror", "relabel", "shift", "drop", "outliers", "wrong", "slip")
SLIP_EVERY_S, SLIP_S = 60.0, 3.0


def parse_perturbations(text: str) -> dict[str, float]:
    """Names and strengths, in order. Raises DataError for an unknown name or strength."""
    found: dict[str, float] = {}
    for part in filter(None, text.split(",")):
        name, _, value = part.partition("=")
        try:
            found[name] = float(value or 0.0)
        except ValueError as error:
            raise DataError(f"--perturb {part}: give a number after {name}=.") from error
        if name not in KINDS:
            raise DataError(f"--perturb {name}: unknown; choose among {', '.join(KINDS)}.")
        share = name not in ("shift", "mirror", "relabel")
        if share and not 0.0 <= found[name] < 1.0:
            raise DataError(f"--perturb {part}: give a share from 0 to below 1.")
    return found


def perturb(data: SurveyData, perturbations: dict[str, float], seed: int = 1) -> SurveyData:
    """The recording with all `perturbations` applied, in a fixed order of kinds."""
    rng = np.random.default_rng(seed)
    for kind in KINDS:
        if kind in perturbations:
            data = _ONE[kind](data, perturbations[kind], rng)
    return data


def _mirror(data: SurveyData, _: float, __: np.random.Generator) -> SurveyData:
    return replace(
        data,
        orders=data.orders * (1.0, 1.0, -1.0),
        polar=data.polar * (1.0, -1.0),
        truth=data.truth * (1.0, 1.0, -1.0, -1.0),
        landmarks={name: (x, -y) for name, (x, y) in data.landmarks.items()},
    )


def _relabel(data: SurveyData, _: float, rng: np.random.Generator) -> SurveyData:
    old = np.unique(np.concatenate([data.subject, np.array(list(data.landmarks), dtype=int)]))
    old = old[old >= 0]
    new = dict(zip(old.tolist(), (1000 + rng.permutation(len(old))).tolist(), strict=True))
    return replace(
        data,
        subject=np.array([new.get(name, -1) for name in data.subject.tolist()], dtype=int),
        landmarks={new[name]: place for name, place in data.landmarks.items()},
    )


def _shift(data: SurveyData, late_s: float, _: np.random.Generator) -> SurveyData:
    return replace(data, sight_t_s=data.sight_t_s + late_s)


def _drop(data: SurveyData, share: float, rng: np.random.Generator) -> SurveyData:
    kept = rng.uniform(size=len(data.polar)) >= share
    return replace(
        data,
        sight_t_s=data.sight_t_s[kept],
        polar=data.polar[kept],
        subject=data.subject[kept],
    )


def _outliers(data: SurveyData, share: float, rng: np.random.Generator) -> SurveyData:
    polar = data.polar.copy()
    hit = rng.uniform(size=len(polar)) < share
    polar[hit, 0] *= rng.uniform(0.1, 3.0, int(hit.sum()))
    return replace(data, polar=polar)


def _wrong(data: SurveyData, share: float, rng: np.random.Generator) -> SurveyData:
    names = np.unique(data.subject)
    hit = rng.uniform(size=len(data.subject)) < share
    subject = data.subject.copy()
    subject[hit] = rng.choice(names, int(hit.sum()))
    return replace(data, subject=subject)


def _slip(data: SurveyData, share: float, _: np.random.Generator) -> SurveyData:
    """The recorded motion cannot change, so the wheels are said to have turned further."""
    orders = data.orders.copy()
    slipping = np.remainder(orders[:, 0] - orders[0, 0], SLIP_EVERY_S) >= SLIP_EVERY_S - SLIP_S
    orders[slipping, 1:] /= 1.0 - share
    return replace(data, orders=orders)


_ONE = {
    "mirror": _mirror,
    "relabel": _relabel,
    "shift": _shift,
    "drop": _drop,
    "outliers": _outliers,
    "wrong": _wrong,
    "slip": _slip,
}
