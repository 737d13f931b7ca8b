"""`sweeper serve`: put the parts together, check the settings, listen."""

from __future__ import annotations

import logging
import os
import re
import socket as sockets
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robot.errors import ConfigError, MissingExtraError
from robot.serve.guard.keys import Keyring

KEYS_FILE, OFF_FILE = "serve-keys.json", "remote-off"


@dataclass(frozen=True, slots=True)
class ServeOptions:
    """What the command line asks for."""

    socket: Path = Path("/run/sweeper/control.sock")
    runs: Path = Path("runs")
    log_ring: Path | None = None
    state: Path = Path("runs")
    host: str = "127.0.0.1"
    port: int = 8321
    names: tuple[str, ...] = ()
    name: str = "Sweeper"
    robot_id: str = ""
    tls_cert: Path | None = None
    tls_key: Path | None = None
    mqtt_host: str = ""
    mqtt_port: int = 1883
    mqtt_user: str = ""
    mqtt_password_file: Path | None = None
    mqtt_tls: bool = False
    mqtt_ca: Path | None = None
    fleet: bool = False
    config: Path | None = None
    installed: Path = Path("/opt/sweeper")


def keyring(state: Path) -> Keyring:
    """The keys kept in the state folder."""
    return Keyring(state / KEYS_FILE)


def switch(state: Path, *, on: bool) -> str:
    """The local switch: while it is off, nobody is let in. Returns a sentence."""
    path = state / OFF_FILE
    try:
        if on:
            path.unlink(missing_ok=True)
        else:
            state.mkdir(parents=True, exist_ok=True)
            path.touch()
    except OSError as error:
        raise ConfigError(
            f"{path}: cannot be changed ({error.strerror}); give a writable --state."
        ) from None
    return f"Remote control is switched {'on' if on else 'off'}."


def serve(options: ServeOptions, ready: Any = None) -> None:
    """Listen until interrupted. Raises ConfigError for settings that would not be safe.

    `ready` is called with the address, token included, before listening begins.
    """
    try:
        import uvicorn
    except ImportError:
        raise MissingExtraError(
            "the web page needs starlette and uvicorn; install `pip install 'sweeper[web]'`."
        ) from None
    keys = keyring(options.state)
    check(options, keys)
    app = build(options, keys)
    scheme = "https" if options.tls_cert else "http"
    shown = "127.0.0.1" if options.host in ("0.0.0.0", "::") else options.host
    shown = f"[{shown}]" if ":" in shown else shown
    address = f"{scheme}://{shown}:{options.port}/?token={keys.new_link()}"
    if ready is not None:
        ready(address)
    from robot.serve.guard.limits import PatientProtocol

    uvicorn.run(
        app,
        host=options.host,
        port=options.port,
        http=PatientProtocol,
        ws="websockets-sansio",
        ws_max_size=4096,
        ws_per_message_deflate=False,
        loop="asyncio",
        interface="asgi3",
        access_log=False,
        log_level="error",  # who knocks at the door must not fill the card with warnings
        server_header=False,
        proxy_headers=False,
        timeout_graceful_shutdown=2,
        h11_max_incomplete_event_size=16 * 1024,
        ssl_certfile=options.tls_cert,
        ssl_keyfile=options.tls_key,
    )


def check(options: ServeOptions, keys: Keyring) -> None:
    """Raise ConfigError rather than listen in an unsafe way."""
    if options.host not in ("127.0.0.1", "localhost", "::1") and not keys.has_password:
        raise ConfigError(
            f"--host {options.host}: other machines may only come in once a password is set; run "
            "`sweeper serve --set-password` first."
        )
    if bool(options.tls_cert) != bool(options.tls_key):
        raise ConfigError("--tls-cert and --tls-key belong together; give both.")
    for path in (options.tls_cert, options.tls_key):
        if path is not None and not path.is_file():
            raise ConfigError(f"{path}: there is no such file; give a PEM file for TLS.")
    with sockets.socket(sockets.AF_INET6 if ":" in options.host else sockets.AF_INET) as probe:
        probe.setsockopt(sockets.SOL_SOCKET, sockets.SO_REUSEADDR, 1)
        try:
            probe.bind((options.host, options.port))
        except OSError as error:
            raise ConfigError(
                f"--host {options.host} --port {options.port}: cannot listen there "
                f"({error.strerror}); choose another."
            ) from None


def build(options: ServeOptions, keys: Keyring) -> Any:
    """The application with all its parts."""
    from robot.serve.app import make_app, shown
    from robot.serve.capability import Robot
    from robot.serve.guard.gate import LOOPBACK, Rules
    from robot.serve.ledger import Ledger
    from robot.serve.runs import Ring, Runs
    from robot.serve.runtime import Runtime
    from robot.serve.world import World

    logging.basicConfig(format="%(name)s: %(message)s", level=logging.WARNING)
    logging.getLogger("asyncio").setLevel(logging.CRITICAL)
    runtime = Runtime(options.socket, World())
    fleet: dict[str, dict[str, Any]] = {}
    robot = Robot(
        runtime,
        runtime.world,
        Runs(options.runs),
        options.name,
        options.robot_id or own_id(),
        fleet,
        has_fleet=options.fleet,
        config=options.config,
        ring=Ring(options.log_ring),
        installed=options.installed,
    )
    off = options.state / OFF_FILE
    hosts = {*LOOPBACK, *(name.lower() for name in options.names)}
    everywhere = options.host in ("0.0.0.0", "::")
    name = sockets.gethostname().lower()
    hosts |= {name, f"{name}.local"} if everywhere else {options.host.lower()}
    rules = Rules(
        keys,
        frozenset(hosts),
        cookie=f"sweeper_{options.port}",
        secure=options.tls_cert is not None,
        any_address=everywhere,
        off=off,
    )
    services = [runtime.watch, Ledger(runtime).run]
    if options.mqtt_host:
        from robot.serve.broker.mqtt import MqttBridge

        bridge = MqttBridge(
            robot,
            broker(options),
            shown,
            fleet=fleet if options.fleet else None,
            allowed=lambda: not off.exists(),
        )
        services.append(bridge.run)
    elif options.fleet:
        raise ConfigError("--fleet needs --mqtt-host: robots meet at a broker.")
    return make_app(robot, rules, services)


def broker(options: ServeOptions) -> Any:
    """The MQTT settings, with the password read from its file. Raises ConfigError."""
    from robot.serve.broker.mqtt import Broker

    password = ""
    if options.mqtt_password_file is not None:
        try:
            password = options.mqtt_password_file.read_text(encoding="utf-8").strip()
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigError(
                f"--mqtt-password-file {options.mqtt_password_file}: cannot be read ({error}); "
                "give a text file with the password."
            ) from None
    return Broker(
        options.mqtt_host,
        options.mqtt_port,
        options.mqtt_user,
        password,
        options.mqtt_tls or options.mqtt_ca is not None,
        options.mqtt_ca,
    )


def own_id() -> str:
    """A name for topics, the same after every start."""
    return re.sub(r"[^a-z0-9_-]", "_", sockets.gethostname().lower())[:40] or os.uname().machine
