"""Pictures of trainings and of what accuracy costs."""

import json

import cv2
import pytest

pytest.importorskip("matplotlib")
from models import curves


def test_a_training_becomes_a_picture_with_a_line_in_either_half(tmp_path):
    lines = [
        {"step": 0, "trained_s": 0.0, "batch": 8},
        *({"step": s, "trained_s": 30.0 * s, "loss": 4.0 / s} for s in range(1, 9)),
        *({"step": s, "trained_s": 30.0 * s, "rooms_epe_px": 2.0 / s} for s in (3, 6, 8)),
    ]
    (tmp_path / "log.jsonl").write_text("\n".join(json.dumps(line) for line in lines))
    curves.draw_training(tmp_path)
    picture = cv2.imread(str(tmp_path / "curve.png")).astype(int)
    coloured = (picture.max(2) - picture.min(2)) > 60
    assert coloured[: len(picture) // 2].any() and coloured[len(picture) // 2 :].any()


def test_costs_are_drawn_for_matchers_whose_instructions_are_known(tmp_path):
    rows = [
        {"matcher": name, "bad2_pct": bad, "bad3_pct": bad - 1}
        for name, bad in (("hybrid", 9.0), ("sgbm", 8.0), ("unknown", 5.0))
    ]
    known = curves.instructions()
    assert {"hybrid", "sgbm", "hybrid_paper"} <= set(known)
    curves.draw_cost(rows, known, tmp_path / "cost.png")
    both = cv2.imread(str(tmp_path / "cost.png"))
    curves.draw_cost(rows[:1], known, tmp_path / "cost.png")
    assert (both != cv2.imread(str(tmp_path / "cost.png"))).any()
