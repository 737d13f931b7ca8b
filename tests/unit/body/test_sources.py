"""What the configuration names is opened: networks by name and hash, cameras by number."""

import pytest

from robot.body.sources import camera_names, open_depth, read_model
from robot.config import parse_config
from robot.errors import ConfigError, ModelError


@pytest.mark.parametrize("name", ["", "hybrid", "hybrid_paper"])
def test_a_network_of_the_manifest_is_read_whole(name):
    assert len(read_model(name)) > 10_000


def test_the_default_network_becomes_a_matcher():
    config = parse_config('[perception]\nmatcher = "onnx"\n')
    assert open_depth(config, config.camera.stereo_camera()) is not None


@pytest.mark.parametrize("name", ["nobody", "/nonexistent/net.onnx"])
def test_a_network_that_is_not_there_is_explained(name):
    with pytest.raises(ModelError, match=r"; \w+|, or"):
        read_model(name)


@pytest.mark.parametrize(
    ("source", "device", "names"),
    [("libcamera", "0", ["0"]), ("libcamera-dual", "0, 1", ["0", "1"]),
     ("libcamera-dual", "0", None), ("libcamera", "0,1", None), ("libcamera", "", None)],
)  # fmt: skip
def test_cameras_are_counted(source, device, names):
    camera = parse_config(f'[camera]\nsource = "{source}"\ndevice = "{device}"\n').camera
    if names is None:
        with pytest.raises(ConfigError, match=r"camera\.device"):
            camera_names(camera)
    else:
        assert camera_names(camera) == names
