"""Errors on held-back pairs, also of networks that leave gaps."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")
from models import validation  # noqa: E402
from models.data.shards import write_shard  # noqa: E402
from models.networks.blocks import Estimate  # noqa: E402


class Steady(torch.nn.Module):
    """Says 8 px everywhere, and nothing in every fourth column if it leaves gaps."""

    def __init__(self, gaps):
        super().__init__()
        self.gaps = gaps
        self.weight = torch.nn.Parameter(torch.zeros(1))

    def forward(self, left, right):
        found = torch.full_like(left, 8.0)
        if self.gaps:
            found[..., ::4] = float("nan")
        return Estimate(found, torch.zeros_like(left))


@pytest.mark.parametrize("gaps", [False, True])
def test_gaps_are_filled_before_errors_are_counted(tmp_path, gaps):
    truth = np.full((2, 240, 320), 8 * 256, np.uint16)
    truth[:, :60] = 10 * 256 + 128  # a quarter is off by 2.5 px
    write_shard(tmp_path / "rooms-0-0000", np.zeros((2, 2, 240, 320), np.uint8), truth)
    found = validation.measure(Steady(gaps), tmp_path, ("rooms",))
    assert found == pytest.approx(
        {"rooms_epe_px": 0.625, "rooms_bad1_pct": 25, "rooms_bad2_pct": 25, "rooms_bad3_pct": 0}
    )
