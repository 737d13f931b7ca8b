"""`sweeper serve` on the command line."""

from __future__ import annotations

import argparse
import getpass
import sys
from pathlib import Path
from typing import Any

from robot.errors import ConfigError
from robot.serve.main import ServeOptions, keyring, serve, switch


def add_options(verb: argparse.ArgumentParser) -> None:
    """The options of `sweeper serve`."""
    default = ServeOptions()
    verb.add_argument("--socket", type=Path, default=default.socket, help="the runtime's socket")
    verb.add_argument("--runs", type=Path, default=default.runs, help="folder of run folders")
    verb.add_argument("--log-ring", type=Path, help="folder of the runtime's --log-ring")
    verb.add_argument("--state", type=Path, help="folder of keys and switch (default: --runs)")
    verb.add_argument("--host", default=default.host, help="default: this machine only")
    verb.add_argument("--port", type=int, default=default.port, help=f"default: {default.port}")
    verb.add_argument(
        "--host-name", action="append", default=[], help="a further name that browsers may use"
    )
    verb.add_argument("--name", default=default.name, help="the robot's name for people")
    verb.add_argument("--id", default="", help="the robot's id in topics (default: host name)")
    verb.add_argument("--tls-cert", type=Path, help="PEM certificate; needs --tls-key")
    verb.add_argument("--tls-key", type=Path, help="PEM key")
    verb.add_argument("--mqtt-host", default="", help="MQTT broker; none: no MQTT")
    verb.add_argument("--mqtt-port", type=int, default=default.mqtt_port)
    verb.add_argument("--mqtt-user", default="")
    verb.add_argument("--mqtt-password-file", type=Path)
    verb.add_argument("--mqtt-tls", action="store_true", help="speak TLS to the broker")
    verb.add_argument("--mqtt-ca", type=Path, help="its certificate authority (PEM)")
    verb.add_argument("--config", type=Path, help="the runtime's settings, for support bundles")
    verb.add_argument("--fleet", action="store_true", help="list all robots of the broker")
    keys = verb.add_argument_group("keys and switch (do one thing and end)")
    keys.add_argument("--set-password", action="store_true", help="asks, or reads one line")
    keys.add_argument("--new-token", metavar="NAME", help="print a token for a program")
    keys.add_argument("--revoke", metavar="NAME", help="make a token worthless")
    keys.add_argument("--off", action="store_true", help="let nobody in until --on")
    keys.add_argument("--on", action="store_true", help="let people in again")


def run(arguments: argparse.Namespace) -> dict[str, Any]:
    """Carry it out; returns the result for --json."""
    state = arguments.state or arguments.runs
    if arguments.off or arguments.on:
        return _said(switch(state, on=arguments.on))
    if arguments.set_password:
        keyring(state).set_password(_read_password())
        return _said("The password is set; everybody who had come in before is out.")
    if arguments.new_token is not None:
        token = keyring(state).new_token(arguments.new_token)
        print(token)
        return {"name": arguments.new_token}
    if arguments.revoke is not None:
        keyring(state).revoke(arguments.revoke)
        return _said(f"The token {arguments.revoke} is worthless now.")
    serve(options(arguments, state), lambda address: print(f"Open {address}", flush=True))
    return {"served": True}


def options(arguments: argparse.Namespace, state: Path) -> ServeOptions:
    """From the command line's words."""
    return ServeOptions(
        socket=arguments.socket,
        runs=arguments.runs,
        log_ring=arguments.log_ring,
        state=state,
        host=arguments.host,
        port=arguments.port,
        names=tuple(arguments.host_name),
        name=arguments.name,
        robot_id=_robot_id(arguments.id),
        tls_cert=arguments.tls_cert,
        tls_key=arguments.tls_key,
        mqtt_host=arguments.mqtt_host,
        mqtt_port=arguments.mqtt_port,
        mqtt_user=arguments.mqtt_user,
        mqtt_password_file=arguments.mqtt_password_file,
        mqtt_tls=arguments.mqtt_tls,
        mqtt_ca=arguments.mqtt_ca,
        fleet=arguments.fleet,
        config=arguments.config,
    )


def _robot_id(given: str) -> str:
    if given and not given.replace("-", "").replace("_", "").isalnum():
        raise ConfigError(f"--id {given}: use letters, digits, - and _ only.")
    return given


def _read_password() -> str:
    if sys.stdin.isatty():
        first = getpass.getpass("New password: ")
        if getpass.getpass("Again: ") != first:
            raise ConfigError("the two passwords differ; try again.")
        return first
    return sys.stdin.readline().rstrip("\n")


def _said(sentence: str) -> dict[str, Any]:
    print(sentence)
    return {"done": sentence}
