"""A trained network through ONNX Runtime.

Contract of the file: inputs `left` and `right`, float32 (1, 1, H, W) holding (grey - 128) / 64;
output `disparity` (1, 1, H, W) in pixels; optionally output `confidence` (1, 1, H, W), 0 to 1.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from robot.errors import MissingExtraError, ModelError
from robot.geometry.stereo import StereoCamera
from robot.messages import DisparityMap
from robot.perception.depth.base import check_pair, disparity_map

INPUTS = ("left", "right")


class OnnxDepth:
    """One session, made for one image size."""

    def __init__(
        self, camera: StereoCamera, model: bytes, max_disparity_px: int, threads: int = 1
    ) -> None:
        """Raises ModelError when the network is damaged or does not fit the camera."""
        self._camera, self._max_px = camera, max_disparity_px
        self._session = _open(model, threads)
        self._outputs = _check_interface(self._session, camera)
        blank = np.zeros((camera.height_px, camera.width_px), np.uint8)
        for name, answer in zip(self._outputs, self._run(blank, blank), strict=True):
            if answer.shape != (1, 1, camera.height_px, camera.width_px):
                raise ModelError(
                    f"the network's output '{name}' has shape {answer.shape} for "
                    f"{camera.width_px}x{camera.height_px} px; it must be (1, 1, height, width)."
                )

    def match(
        self,
        left: np.ndarray,
        right: np.ndarray,
        *,
        t_ns: int = 0,
        given: np.ndarray | None = None,
    ) -> DisparityMap:
        """See `Depth.match`."""
        check_pair(self._camera, left, right)
        answers = [answer[0, 0] for answer in self._run(left, right)]
        confidence = answers[1] if len(answers) > 1 else None
        return disparity_map(t_ns, answers[0], self._max_px, confidence)

    def _run(self, left: np.ndarray, right: np.ndarray) -> list[np.ndarray]:
        feed = {
            name: (image.astype(np.float32)[None, None] - np.float32(128.0)) * np.float32(1 / 64)
            for name, image in zip(INPUTS, (left, right), strict=True)
        }
        return list(self._session.run(list(self._outputs), feed))


def _open(model: bytes, threads: int) -> Any:
    try:
        import onnxruntime
    except ImportError:
        raise MissingExtraError(
            "perception.matcher is 'onnx' but onnxruntime is not installed; install the package "
            "again, or set perception.matcher to 'sgbm'."
        ) from None
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 3
    # Spinning workers would take the cores from the control loop between two frames.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    try:
        return onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime's own classes derive from Exception only
        what = str(error).splitlines()[0][:160] if str(error) else type(error).__name__
        raise ModelError(
            f"the network cannot be loaded ({what}); export it again or restore the file."
        ) from None


def _check_interface(session: Any, camera: StereoCamera) -> tuple[str, ...]:
    """Names of the outputs to ask for. Raises ModelError for another interface or image size."""
    inputs = {node.name: node for node in session.get_inputs()}
    if set(inputs) != set(INPUTS):
        raise ModelError(
            f"the network's inputs are {', '.join(sorted(inputs))}; export it with left and right."
        )
    wanted = (1, 1, camera.height_px, camera.width_px)
    for name, node in inputs.items():
        fits = len(node.shape) == 4 and all(
            not isinstance(have, int) or have == want
            for have, want in zip(node.shape, wanted, strict=True)
        )
        if not fits or node.type != "tensor(float)":
            raise ModelError(
                f"the network's input '{name}' is {node.type} of shape {node.shape} but the camera "
                f"needs float of {list(wanted)}; choose a network for {camera.width_px}x"
                f"{camera.height_px} px or change the camera's size."
            )
    outputs = [node.name for node in session.get_outputs()]
    if "disparity" not in outputs:
        raise ModelError(
            f"the network's outputs are {', '.join(outputs)}; export it with an output disparity."
        )
    return ("disparity", "confidence") if "confidence" in outputs else ("disparity",)
