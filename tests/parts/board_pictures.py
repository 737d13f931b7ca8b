"""Boards as two cameras see them: corners by projection, pictures by warping."""

import cv2
import numpy as np

from robot.calibrate.board import Found
from robot.calibrate.stereo import View

SIZE = (640, 480)
MATRIX = np.array([[520.0, 0.0, 322.0], [0.0, 523.0, 236.0], [0.0, 0.0, 1.0]])
LEFT_LENS = np.array([-0.12, 0.06, 0.0004, -0.0003, 0.0])
RIGHT_LENS = np.array([-0.11, 0.05, -0.0002, 0.0005, 0.0])
TURN = np.array([0.01, -0.02, 0.015])  # right_from_left, as a rotation vector
MOVE = np.array([-0.06, 0.001, -0.0005])


def right_from_left():
    pose = np.eye(4)
    pose[:3, :3] = cv2.Rodrigues(TURN)[0]
    pose[:3, 3] = MOVE
    return pose


def board_poses(count, board, rng):
    """Poses of the board before the left eye, all over the image and tilted."""
    middle = np.array([board.columns - 1, board.rows - 1, 0.0]) * board.square_m / 2.0
    for k in range(count):
        turn = rng.uniform(-0.5, 0.5, 3)
        z = rng.uniform(0.3, 0.5)
        aim = np.array([-0.3 + 0.6 * (k % 4) / 3.0, -0.2 + 0.4 * (k // 4 % 3) / 2.0]) * z * 0.6
        rotation = cv2.Rodrigues(turn)[0]
        yield rotation, np.array([*aim, z]) - rotation @ middle


def project(points, rotation, move, right):
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, move
    lens = LEFT_LENS
    if right:
        pose, lens = right_from_left() @ pose, RIGHT_LENS
    pixels, _ = cv2.projectPoints(points, cv2.Rodrigues(pose[:3, :3])[0], pose[:3, 3], MATRIX, lens)
    return pixels[:, 0].astype(np.float32)


def views(board, count=14, noise_px=0.08, seed=1):
    rng = np.random.default_rng(seed)
    made = []
    for k, (rotation, move) in enumerate(board_poses(count, board, rng)):
        points = board.points_m()
        eyes = []
        for right in (False, True):
            pixel = project(points, rotation, move, right)
            pixel += rng.normal(0.0, noise_px, pixel.shape).astype(np.float32)
            eyes.append(Found(np.arange(len(points)), pixel))
        made.append(View(f"view{k}", *eyes))
    return made


def picture(board, rotation, move, right):
    """Grey picture of the board through the lens, twice as fine and averaged down."""
    scale = 2500.0  # a square of 24 mm is a whole number of pixels
    drawn = board.draw(scale)
    big = (2 * SIZE[0], 2 * SIZE[1])
    u, v = np.meshgrid(np.arange(big[0]) / 2 - 0.25, np.arange(big[1]) / 2 - 0.25)
    pixels = np.stack([u, v], axis=-1).reshape(-1, 1, 2)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, move
    lens = LEFT_LENS
    if right:
        pose, lens = right_from_left() @ pose, RIGHT_LENS
    rays = cv2.undistortPoints(pixels, MATRIX, lens)[:, 0]
    plane = np.linalg.inv(np.column_stack([pose[:3, 0], pose[:3, 1], pose[:3, 3]]))
    on_board = np.column_stack([rays, np.ones(len(rays))]) @ plane.T
    xy = on_board[:, :2] / on_board[:, 2:]
    # The first inner corner is one square and a white margin of one square inside the picture.
    where = ((xy + 2.0 * board.square_m) * scale - 0.5).astype(np.float32)
    maps = (where[:, 0].reshape(big[1], big[0]), where[:, 1].reshape(big[1], big[0]))
    # Far more picture than pixels: average it down first.
    seen = cv2.remap(cv2.GaussianBlur(drawn, (0, 0), 1.2), *maps, cv2.INTER_LINEAR, borderValue=110)
    return cv2.resize(seen, SIZE, interpolation=cv2.INTER_AREA)
