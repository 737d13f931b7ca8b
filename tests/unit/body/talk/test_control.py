"""The control socket: requests arrive, nonsense is answered, nothing blocks."""

import socket
import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.body.talk.control import MAX_LINE_BYTES, ControlSocket, ask, parse_request
from robot.errors import HardwareError, RequestError
from robot.messages import Answer


@pytest.fixture
def control(tmp_path):
    server = ControlSocket(tmp_path / "control.sock")
    yield server
    server.close()


def asked(control, path, verb, *args):
    """Ask from another thread while polling as the loop does."""
    answers = []
    client = threading.Thread(target=lambda: answers.append(ask(path, verb, list(args))))
    client.start()
    requests = []
    while client.is_alive():
        requests += control.poll(7)
        client.join(0.001)
    return requests, answers[0]


def test_a_request_reaches_the_loop_with_its_time(control, tmp_path):
    requests, answer = asked(control, tmp_path / "control.sock", "dock")
    assert [(r.t_ns, r.verb) for r in requests] == [(7, "dock")]
    assert answer["accepted"] is True


def test_an_unknown_verb_is_refused_with_the_choices(control, tmp_path):
    requests, answer = asked(control, tmp_path / "control.sock", "dance")
    assert requests == []
    assert answer["accepted"] is False and "start" in answer["reason"]


def test_the_missions_own_answer_is_waited_for(tmp_path):
    control = ControlSocket(tmp_path / "judged.sock", judged=True)
    answers = []
    client = threading.Thread(
        target=lambda: answers.append(ask(tmp_path / "judged.sock", "rooms", []))
    )
    client.start()
    requests = []
    while not requests:
        requests += control.poll(7)
    assert not answers
    control.answer(Answer(8, 99, "rooms", True, "somebody else's"))
    control.answer(Answer(8, requests[0].request_id, "rooms", True, "two", '{"n": 2}'))
    client.join(5.0)
    assert answers == [{"accepted": True, "reason": "two", "data": {"n": 2}}]
    control.answer(Answer(9, requests[0].request_id, "rooms", True, "twice"))
    control.close()


def test_who_gets_no_answer_is_told_so(tmp_path):
    control = ControlSocket(tmp_path / "judged.sock", judged=True)
    answers = []
    client = threading.Thread(
        target=lambda: answers.append(ask(tmp_path / "judged.sock", "start", []))
    )
    client.start()
    now_ns = 0
    while client.is_alive():
        now_ns += 50_000_000
        control.poll(now_ns)
        client.join(0.001)
    assert answers[0]["accepted"] is False and "in time" in answers[0]["reason"]
    control.close()


def test_books_answer_for_themselves(control, tmp_path):
    def reset(args):
        raise RequestError("no such part.")

    control.books = {"history": lambda args: {"reason": "3"}, "consumables reset": reset}
    path = tmp_path / "control.sock"
    assert asked(control, path, "history") == ([], {"accepted": True, "reason": "3"})
    requests, answer = asked(control, path, "consumables reset", "x")
    assert requests == [] and answer == {"accepted": False, "reason": "no such part."}


def test_verbs_of_several_words_arrive_as_one(control, tmp_path):
    requests, _ = asked(control, tmp_path / "control.sock", "go", "to", "1", "-2")
    assert [(r.verb, r.args) for r in requests] == [("go to", ("1", "-2"))]


def test_a_silent_client_does_not_block_the_loop(control, tmp_path):
    with socket.socket(socket.AF_UNIX) as client:
        client.connect(str(tmp_path / "control.sock"))
        client.sendall(b'{"verb": "st')
        for _ in range(5):
            assert control.poll(0) == []
        client.sendall(b'art"}\n')
        requests = [r for _ in range(5) for r in control.poll(0)]
    assert [r.verb for r in requests] == ["start"]


def test_an_endless_line_is_cut_off(control, tmp_path):
    with socket.socket(socket.AF_UNIX) as client:
        client.settimeout(2)
        client.connect(str(tmp_path / "control.sock"))
        client.sendall(b"x" * (2 * MAX_LINE_BYTES))
        for _ in range(5):
            assert control.poll(0) == []
        assert b'"accepted": false' in client.recv(4096)


def test_a_missing_robot_is_explained(tmp_path):
    with pytest.raises(HardwareError, match="no robot answers"):
        ask(tmp_path / "none.sock", "start", [])


@given(st.binary(max_size=200))
def test_any_bytes_are_answered_with_a_sentence(line):
    _, reason = parse_request(line, 0)
    assert reason
