"""Our lines in the board's config.txt."""

from card import run, source


def test_the_boards_configuration_gets_its_lines_once_and_loses_only_them(tmp_path, root):
    path = root / "boot/firmware/config.txt"
    before = path.read_text()
    for _ in range(3):
        run(root, "install", source(tmp_path))
    text = path.read_text()
    assert text.startswith(before) and text.count("dtparam=i2c_arm=on") == 1
    assert "[all]\ndtparam=i2c_arm" in text  # not only under [pi4]
    run(root, "uninstall")
    assert path.read_text() == before
