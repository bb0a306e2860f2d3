"""Who may talk to the page's server, and for what: rules, and a real server asked without a browser."""

from __future__ import annotations

import logging
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from viewer_scenes import need_drawing
from web_pages import Served, served, three

from resfit.viewer.web.guard import HEADERS, LAUNCHER, Gate, is_ours, is_plain
from resfit.viewer.web.serve import is_local, shown_host

HOST = "127.0.0.1:8080"


@pytest.fixture
def gate() -> Gate:
    return Gate("right")


def ask(gate: Gate, path: str = "/index.html", method: str = "GET", **given: str | None) -> str | None:
    """What a gate says to a request."""
    wanted = {"query": None, "cookie": None, "origin": None, **given}
    return gate.refusal(method, path, host=HOST, **wanted)


@pytest.mark.parametrize(
    "given", [{"query": "right"}, {"cookie": "right"}, {"query": "right", "cookie": "old"}]
)
def test_token_opens(gate: Gate, given: dict[str, str]) -> None:
    assert ask(gate, **given) is None


@pytest.mark.parametrize(
    "given",
    [{}, {"query": ""}, {"query": "wrong"}, {"cookie": "wrong"}, {"query": "", "cookie": "right"},
     {"query": "wrong", "cookie": "right"}, {"query": "righ"}, {"query": "rightt"}, {"query": "ríght"}],
)  # fmt: skip
def test_nothing_else_does(gate: Gate, given: dict[str, str]) -> None:
    assert "token" in (ask(gate, **given) or "")


def test_tokens_differ() -> None:
    tokens = {Gate().token for _ in range(20)}
    assert len(tokens) == 20 and min(map(len, tokens)) >= 20
    assert Gate().cookie(1) != Gate().cookie(2)


def test_pages_from_elsewhere_are_refused(gate: Gate) -> None:
    assert ask(gate, cookie="right", origin=f"http://{HOST}") is None
    for origin in ("http://127.0.0.1:9999", "https://example.org", "null", "http://127.0.0.1"):
        assert ask(gate, "/ws", cookie="right", origin=origin) is not None


def test_only_reading(gate: Gate) -> None:
    assert ask(gate, LAUNCHER, "POST", cookie="right") is None
    for method in ("POST", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE"):
        assert ask(gate, "/index.html", method, cookie="right") is not None


@pytest.mark.parametrize(
    "path",
    ["/../..", "/%2e%2e/%2e%2e", "/..%2f..%2fetc", "/%252e%252e/x", "/a/../b", "/..\\..", "/%5c..%5c", "/a%00.html",
     "/./x", "/%25252e%25252e/", "/%ff%2e%2e/..", "/x%0d%0ay"],
)  # fmt: skip
def test_paths_that_go_elsewhere(path: str) -> None:
    assert not is_plain(path)


@pytest.mark.parametrize(
    "path", ["/", "/index.html", "/assets/index-D.js", "/__trame_rca_2.1/x.js", "/a%20b"]
)
def test_paths_of_the_page(path: str) -> None:
    assert is_plain(path)


def test_logs_say_nothing_of_requests_that_are_none() -> None:
    http = pytest.importorskip("aiohttp.http", reason="the extra web is not installed")

    def record(text: str, error: Exception | None = None) -> logging.LogRecord:
        told = None if error is None else (type(error), error, None)
        return logging.LogRecord("aiohttp.server", logging.ERROR, __file__, 1, text, None, told)

    assert not is_ours(record("Error handling request", http.HttpProcessingError(message="no HTTP")))
    assert not is_ours(record("Traceback (most recent call last):\n ..."))
    assert is_ours(record("Error handling request", ValueError("a defect"))) and is_ours(record("started"))


def test_hosts() -> None:
    assert is_local("127.0.0.1") and is_local("::1") and is_local("localhost")
    assert not is_local("0.0.0.0") and not is_local("example.org")
    assert shown_host("::1") == "[::1]" and shown_host("0.0.0.0") not in ("0.0.0.0", "")


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """A real server, in a folder with a secret."""
    pytest.importorskip("trame_vuetify", reason="the extra web is not installed")
    need_drawing()
    folder = tmp_path_factory.mktemp("guarded")
    three().save(folder / "assembly.json")
    (folder / "secret.txt").write_text("nobody's business")
    with served(folder / "assembly.json") as made:
        yield made


def cookie(server: Served) -> dict[str, str]:
    """What a browser that has opened the address sends along."""
    return {"Cookie": f"resfit_{server.port}={server.token}"}


@pytest.mark.slow
def test_without_the_token_nothing_is_served(server: Served) -> None:
    listed = [
        "/",
        "/index.html",
        "/vue.global.js",
        "/ws",
        "/nothing",
        "/assets/",
        "/?token=wrong",
        "/?token=",
    ]
    for target in listed:
        status, content, headers = server.ask(target)
        assert (status, b"<html" in content, "Set-Cookie" in headers) == (403, False, False), target
    assert server.ask(LAUNCHER, method="POST")[0] == 403


@pytest.mark.slow
def test_with_it_the_page_is_and_its_files_by_cookie(server: Served) -> None:
    status, _, headers = server.ask(f"/?token={server.token}")
    assert status == 302 and headers["Location"].startswith("index.html?token=")
    assert HEADERS.items() <= headers.items()
    status, content, headers = server.ask(f"/index.html?token={server.token}")
    assert status == 200 and b"vue.global.js" in content
    assert headers["Set-Cookie"].startswith(f"resfit_{server.port}={server.token};")
    assert {"HttpOnly", "SameSite=Strict"} <= set(headers["Set-Cookie"].split("; "))
    assert (
        headers["Referrer-Policy"] == "no-referrer"
        and "default-src 'self'" in headers["Content-Security-Policy"]
    )
    assert server.ask("/vue.global.js", cookie(server))[0] == 200


@pytest.mark.slow
@pytest.mark.parametrize(
    "target",
    ["/../..", "/../../../../../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "/..%2f..%2f..%2fetc%2fpasswd",
     "/assets/../../../__init__.py", "/%252e%252e/%252e%252e/etc/passwd", "/..%5c..%5cetc", "//etc/passwd",
     "/etc/passwd", "/secret.txt", "/assembly.json", "/./secret.txt", "/assets", "/assets/", "/%00"],
)  # fmt: skip
def test_nothing_but_the_page_even_with_it(server: Served, target: str) -> None:
    status, content, _ = server.ask(target, cookie(server))
    assert status in (301, 302, 400, 403, 404)
    assert b"root:" not in content and b"business" not in content and b"primitives" not in content
    assert b"Index of" not in content


@pytest.mark.slow
def test_web_socket(server: Served) -> None:
    own = {"Origin": f"http://127.0.0.1:{server.port}"}
    assert server.upgrade({**own, **cookie(server)}) == 101
    assert server.upgrade(own) == 403
    assert server.upgrade({**own, "Cookie": f"resfit_{server.port}=wrong"}) == 403
    assert server.upgrade({"Origin": "http://127.0.0.1:1", **cookie(server)}) == 403
    assert server.upgrade(own, "/ws?token=wrong") == 403


def run(*arguments: str, code: str = "") -> tuple[int, str, str]:
    """What the command line does, in a process of its own."""
    script = f"import sys\n{code}\nfrom resfit.cli import main\nsys.exit(main({list(arguments)!r}))"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=120, check=False
    )
    return done.returncode, done.stdout, done.stderr


def test_without_the_extra_a_sentence(tmp_path: Path) -> None:
    three().save(tmp_path / "assembly.json")
    hide = "import importlib.util as u\nfind = u.find_spec\n"
    hide += "u.find_spec = lambda name, *more: None if name.startswith('trame') else find(name, *more)"
    code, output, complaint = run("view", str(tmp_path), "--web", code=hide)
    assert (code, output) == (2, "")
    assert "-m pip install 'trame-pyvista>=" in complaint and complaint.count("\n") == 1


@pytest.mark.slow
def test_ports_and_hosts(server: Served, tmp_path: Path) -> None:
    three().save(tmp_path / "assembly.json")
    code, output, complaint = run("view", str(tmp_path), "--web", "--port", str(server.port))
    assert (code, output) == (2, "") and f"port {server.port}" in complaint and complaint.count("\n") == 1
    code, output, complaint = run("view", str(tmp_path), "--web", "--port", "70000")
    assert (code, output) == (2, "") and "out of range" in complaint
    code, output, complaint = run("view", str(tmp_path), "--web", "--host", "not.a.host.invalid")
    assert (code, output) == (2, "") and complaint.count("\n") == 1
