"""`sweeper check`: every finding from a machine made of files, fakes for what is connected."""

import io
import json
import tarfile
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from robot.body.checks import devices as check_devices
from robot.body.checks.bundle import blank, write_bundle
from robot.body.checks.check import CODES, check
from robot.body.checks.devices import check_calibration, check_cameras, check_controller, check_imu
from robot.body.checks.machine import Machine, check_machine
from robot.calibrate.files import Provenance, write_calibration
from robot.config import parse_config
from robot.errors import CalibrationError, HardwareError
from robot.hardware.fakes import FakeI2cBus, FakeMpu6050
from robot.hardware.imu_i2c import Imu
from robot.messages import LinkState
from robot.perception.calibration import Eye, StereoCalibration


def machine(tmp_path, files=None, **options):
    for name, text in (files or {}).items():
        path = tmp_path / "root" / name.lstrip("/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    given = {"throttled": lambda: "", "clock_s": lambda: 2e9, "uid": 1000, "groups": (44, 20, 998)}
    return Machine(root=tmp_path / "root", state=tmp_path, **(given | options))


def found(config, made, code):
    return next(f for f in check_machine(config, made) if f["code"] == code)


CONFIG = parse_config("")
GROUP = "video:x:44:\ndialout:x:20:\ni2c:x:998:\n"
ALL = "/etc/group"


@pytest.mark.parametrize(
    ("groups", "level", "said"),
    [
        ((44, 20, 998), "ok", ""),
        ((20,), "warn", "video (cameras), i2c"),
        ((44, 998), "warn", "dia"),
    ],
)
def test_groups(tmp_path, groups, level, said):
    got = found(CONFIG, machine(tmp_path, {ALL: GROUP}, groups=groups), "groups")
    assert got["level"] == level and said in got["cause"]
    assert ("usermod" in got["remedy"]) == (level == "warn")


@pytest.mark.parametrize(
    ("text", "source", "level", "lacks"),
    [
        ("dtparam=i2c_arm=on\ncamera_auto_detect=1\n", "libcamera", "ok", ""),
        ("dtparam=i2c_arm=on\ndtoverlay=imx219,cam0\n", "libcamera-dual", "ok", ""),
        ("dtparam=i2c_arm=on\n", "uvc", "ok", ""),
        ("#dtparam=i2c_arm=on\n", "uvc", "warn", "dtparam=i2c_arm=on"),
        ("dtparam=i2c_arm=on\ncamera_auto_detect=0\n", "libcamera", "warn", "camera_auto_detect"),
        (None, "libcamera", "ok", ""),
    ],
)
def test_overlays(tmp_path, text, source, level, lacks):
    files = {"/boot/firmware/config.txt": text} if text is not None else {}
    config = parse_config(f'[camera]\nsource = "{source}"\n')
    got = found(config, machine(tmp_path, files), "overlays")
    assert got["level"] == level and lacks in got["cause"]


@pytest.mark.parametrize(
    ("said", "heat", "supply"),
    [
        ("0x0", "ok", "ok"), ("0x1", "ok", "error"), ("0x10000", "ok", "warn"),
        ("0x4", "warn", "ok"), ("0x80000", "warn", "ok"), ("0x50005", "warn", "error"),
        ("", "ok", "ok"), ("nonsense", "ok", "ok"),
    ],
)  # fmt: skip
def test_heat_and_supply(tmp_path, said, heat, supply):
    made = machine(tmp_path, throttled=lambda: said)
    assert found(CONFIG, made, "throttling")["level"] == heat
    assert found(CONFIG, made, "undervoltage")["level"] == supply


def test_supply_is_read_where_a_service_can_read_it(tmp_path):
    sysfs = "/sys/devices/platform/soc/soc:firmware/get_throttled"
    got = found(CONFIG, machine(tmp_path, {sysfs: "1\n"}), "undervoltage")
    assert got["level"] == "error"
    alarm = {"/sys/class/hwmon/hwmon2/name": "rpi_volt\n",
             "/sys/class/hwmon/hwmon2/in0_lcrit_alarm": "1\n"}  # fmt: skip
    (tmp_path / "b").mkdir()
    assert found(CONFIG, machine(tmp_path / "b", alarm), "undervoltage")["level"] == "error"


def test_clock_and_memory(tmp_path):
    made = machine(
        tmp_path, {"/proc/meminfo": "MemAvailable:    100000 kB\n"}, clock_s=lambda: 1000.0
    )
    assert found(CONFIG, made, "clock")["level"] == "warn"
    assert found(CONFIG, made, "memory")["level"] == "warn"
    made = machine(tmp_path, {"/proc/meminfo": "MemAvailable:    700000 kB\n"})
    assert found(CONFIG, made, "memory")["level"] == "ok"
    assert found(CONFIG, made, "clock")["level"] == "ok"


def test_a_full_card(tmp_path, monkeypatch):
    usage = SimpleNamespace(free=50 * 2**20)
    monkeypatch.setattr("robot.body.checks.machine.shutil.disk_usage", lambda path: usage)
    got = found(CONFIG, machine(tmp_path), "disk")
    assert got["level"] == "error" and got["cause"] == "50 MB free"


# ---------------------------------------------------------------- calibration


def calibrated(tmp_path, age_days=3, epipolar=0.1, move=-0.06):
    pose = np.eye(4)
    pose[0, 3] = move
    matrix = np.array([[456.0, 0, 319.5], [0, 456.0, 239.5], [0, 0, 1]])
    eye = Eye(640, 480, matrix, np.zeros(5))
    date = (datetime.now(UTC) - timedelta(days=age_days)).isoformat(timespec="seconds")
    path = tmp_path / "stereo.yaml"
    text = write_calibration(
        StereoCalibration(eye, eye, pose), "opencv", Provenance(date, 0.2, epipolar)
    )[0]
    path.write_text(text)
    return parse_config(f'[camera]\ncalibration = "{path}"\n')


def test_calibration_age_and_quality(tmp_path):
    [fresh] = check_calibration(calibrated(tmp_path))
    assert fresh["level"] == "ok" and "640x480" in fresh["cause"] and "3 days" in fresh["cause"]
    [old] = check_calibration(calibrated(tmp_path, age_days=500))
    assert old["level"] == "warn" and "500 days" in old["cause"]
    [poor] = check_calibration(calibrated(tmp_path, epipolar=0.9))
    assert poor["level"] == "warn" and "0.9000 px" in poor["cause"]
    with pytest.raises(CalibrationError, match="swap"):
        list(check_calibration(calibrated(tmp_path, move=0.06)))
    [none] = check_calibration(parse_config(""))
    assert none["level"] == "warn" and "calibrate stereo" in none["remedy"]


# ---------------------------------------------------------------- devices


def pictures(tmp_path, change=lambda left, right: (left, right)):
    rng = np.random.default_rng(1)
    wide = cv2.GaussianBlur(rng.integers(0, 255, (240, 360)).astype(np.uint8), (0, 0), 1.5)
    wide = cv2.normalize(wide, None, 20, 230, cv2.NORM_MINMAX)
    left, right = change(wide[:, 20:340].copy(), wide[:, 30:350].copy())
    folder = tmp_path / "frames"
    folder.mkdir()
    for n in range(12):
        cv2.imwrite(str(folder / f"left{n}.png"), left)
        cv2.imwrite(str(folder / f"right{n}.png"), right)
    return parse_config(f'[camera]\nsource = "folder"\ndevice = "{folder}"\nrate_hz = 60\n')


def test_a_good_pair_of_eyes(tmp_path):
    got = {f["code"]: f for f in check_cameras(pictures(tmp_path))}
    assert {code: f["level"] for code, f in got.items()} == {"camera": "ok", "sync": "ok"}
    assert "320x240 px" in got["camera"]["cause"]


@pytest.mark.parametrize(
    ("change", "code", "said"),
    [
        (lambda left, right: (left, np.full_like(right, 3)), "camera", "right eye sees next to"),
        (lambda left, right: (np.full_like(left, 250), right), "camera", "left eye sees next to"),
        (lambda left, right: (left, left), "camera", "the same picture"),
        (lambda left, right: (left, np.roll(right, 3, axis=0)), "calibration", "has moved"),
    ],
)
def test_what_is_wrong_with_pictures_is_told(tmp_path, change, code, said):
    got = [f for f in check_cameras(pictures(tmp_path, change)) if f["level"] != "ok"]
    assert got[0]["code"] == code
    assert said in got[0]["cause"] and got[0]["remedy"]


def test_two_cameras_that_are_not_triggered_together(tmp_path, monkeypatch):
    config = pictures(tmp_path)
    dual = parse_config('[camera]\nsource = "libcamera-dual"\ndevice = "0,1"\n')
    source = check_devices.open_stereo(config)

    class Dual:
        difference_ns = 8_000_000
        problem = ""
        read, close = source.read, source.close

    monkeypatch.setattr(check_devices, "open_stereo", lambda config: Dual())
    got = {f["code"]: f for f in check_cameras(dual)}
    assert got["sync"]["level"] == "error" and "8.0 ms" in got["sync"]["cause"]


class Wheels:
    """A bridge with somebody, or nobody, at the other end."""

    def __init__(self, build=None, connected=True):
        who = SimpleNamespace(board=2, build=build) if connected else None
        self.link = SimpleNamespace(controller=who, problem="protocol 9")
        self._connected, self.closed = connected, False

    def poll(self, now_ns):
        return [LinkState(now_ns, self._connected)]

    def close(self):
        self.closed = True


def test_controller_and_firmware(monkeypatch):
    monkeypatch.setattr(check_devices, "build_number", lambda board: 0xABC)
    monkeypatch.setattr("robot.body.halt.ANSWER_S", 0.1)
    for build, level in ((0xABC, "ok"), (0x123, "warn")):
        wheels = Wheels(build)
        monkeypatch.setattr(check_devices, "open_wheels", lambda *a, w=wheels: w)
        got = {f["code"]: f for f in check_controller(CONFIG)}
        assert got["serial"]["level"] == "ok"
        assert got["firmware"]["level"] == level
        assert wheels.closed
    assert "wheels flash" in got["firmware"]["remedy"]


def test_a_silent_controller(monkeypatch):
    wheels = Wheels(connected=False)
    monkeypatch.setattr(check_devices, "open_wheels", lambda *a: wheels)
    with pytest.raises(HardwareError, match="protocol 9"):
        list(check_controller(CONFIG))
    assert wheels.closed


def test_an_imu_mounted_another_way(monkeypatch):
    chip = FakeMpu6050()
    chip.pull(0, 16384, 0)
    real, n = chip.read, [0]

    def read(register):
        n[0] += 1
        return real(register) ^ (n[0] % 7 & 1 if register == 0x48 else 0)

    chip.read = read
    imu = Imu(FakeI2cBus({0x68: chip}), sleep=lambda s: None)
    monkeypatch.setattr(check_devices, "open_imu", lambda config: imu)
    [got] = check_imu(CONFIG)
    assert got["level"] == "warn" and "imu_axis = 'y'" in got["remedy"]


def test_every_code_is_reported_once_everything_is_missing(tmp_path):
    findings = check(CONFIG, machine(tmp_path))
    codes = [f["code"] for f in findings]
    assert codes == sorted(codes, key=CODES.index)
    assert set(codes) >= set(CODES) - {"sync", "firmware"}
    assert all(set(f) == {"code", "level", "cause", "remedy"} for f in findings)
    assert all(bool(f["remedy"]) == (f["level"] != "ok") for f in findings)


# ---------------------------------------------------------------- the bundle

SECRETS = [
    "hunter2", "s3cr3tT0ken", "MyHomeWifi", "b8:27:eb:12:34:56", "192.168.7.23", "alice",
    "00000000deadbeef", "MIIEvQIBADANBg", "fe80::1234:5678:9abc:def0",
]  # fmt: skip


def test_the_bundle_holds_texts_but_no_secret_and_no_picture(tmp_path):
    files = {
        "/proc/cpuinfo": "Model: Raspberry Pi 3\nSerial\t\t: 00000000deadbeef\n",
        "/boot/firmware/config.txt": "dtparam=i2c_arm=on\n",
        "/boot/firmware/cmdline.txt": "psk=hunter2 ssid=MyHomeWifi root=/home/alice\n",
        "/etc/os-release": "token: s3cr3tT0ken\nmqtt://bob:hunter2@192.168.7.23/\n"
        "link b8:27:eb:12:34:56 fe80::1234:5678:9abc:def0\nAuthorization: Bearer s3cr3tT0ken\n"
        "-----BEGIN PRIVATE KEY-----\nMIIEvQIBADANBg\n-----END PRIVATE KEY-----\n",
    }
    made = machine(tmp_path, files)
    run = tmp_path / "runs" / "20300101-live"
    run.mkdir(parents=True)
    (run / "summary.json").write_text('{"state": "error", "password": "hunter2"}')
    (run / "map.png").write_bytes(b"\x89PNG\r\n\x1a\npicture")
    (run / "log.mcap").write_bytes(b"\x89MCAP0\r\nframes")
    target = tmp_path / "bundle.tgz"
    names = write_bundle(target, CONFIG, [{"code": "disk"}], made)
    texts = {}
    with tarfile.open(fileobj=io.BytesIO(target.read_bytes())) as archive:
        for entry in archive:
            texts[entry.name] = archive.extractfile(entry).read()
    everything = b"\n".join(texts.values())
    for secret in SECRETS:
        assert secret.encode() not in everything, secret
    assert b"PNG" not in everything and b"MCAP" not in everything
    assert json.loads(texts["sweeper/check.json"]) == {"checks": [{"code": "disk"}]}
    assert b"Raspberry Pi 3" in everything and b"dtparam=i2c_arm=on" in everything
    assert "runs/20300101-live.json" in names
    assert b"map.png" in texts["sweeper/files.txt"]  # its name and size, not its content


@pytest.mark.parametrize(
    "text", ["frames 320x240 at 10.0 Hz", "t=12:34:56 stop", "127.0.0.1", "build 0a1b2c3d"]
)
def test_what_is_no_secret_stays(text):
    assert blank(text) == text
