"""A wide network that begins with what a narrow one knows."""

import pytest

torch = pytest.importorskip("torch")
from models.networks import build  # noqa: E402
from models.widen import widened  # noqa: E402


@pytest.fixture(autouse=True)
def _quiet():
    torch.manual_seed(0)
    torch.set_num_threads(1)


def learnt(name):
    """A network whose normalisations have seen something."""
    network = build(name)
    network(torch.randn(2, 1, 64, 96), torch.randn(2, 1, 64, 96))
    return network.eval()


def test_the_wide_one_says_almost_what_the_narrow_one_says():
    narrow, wide, eye = learnt("hybrid"), build("hybrid_m").eval(), torch.randn(1, 1, 64, 96)
    before = wide(eye, eye).disparity
    wide.load_state_dict(widened(narrow.state_dict(), wide))
    with torch.no_grad():
        said, wanted = wide(eye, eye).disparity, narrow(eye, eye).disparity
    assert (said - wanted).abs().median() < 0.1 * (before - wanted).abs().median()


def test_new_channels_learn():
    wide = build("hybrid_m")
    wide.load_state_dict(widened(learnt("hybrid").state_dict(), wide))
    wide(torch.randn(2, 1, 64, 96), torch.randn(2, 1, 64, 96)).disparity.sum().backward()
    gather = wide.gather.weight.grad
    assert gather[:48, 8:16].abs().max() > 0  # old outputs begin to listen to new features


def test_the_same_network_stays_as_it_is():
    network = learnt("hybrid")
    state = {name: value.clone() for name, value in network.state_dict().items()}
    for name, value in widened(state, build("hybrid")).items():
        torch.testing.assert_close(value, state[name])


def test_a_wider_or_another_network_is_refused():
    with pytest.raises(ValueError, match="wider"):
        widened(build("hybrid_m").state_dict(), build("hybrid"))
    with pytest.raises(ValueError, match="another network"):
        widened(build("similarity").state_dict(), build("hybrid"))
