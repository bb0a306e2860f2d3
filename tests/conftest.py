"""Fixtures shared by all tests: the devices present here, seeded random numbers, and one headless Chromium."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

if TYPE_CHECKING:
    import warp as wp
    from playwright.sync_api import Browser, Page

CHROMIUM_FLAGS = [
    "--headless",
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
]
"""WebGL 2 by software, and nothing sent from a fresh profile."""


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run tests that ask for `device` on the CPU and, where there is one, on the first GPU."""
    if "device" not in metafunc.fixturenames:
        return
    # Imported here because tests that touch no kernel (documents, the architecture) need not wait for Warp.
    import warp

    from resfit.kernels.runtime.launch import start

    start()
    names = ["cpu"] + [found.alias for found in warp.get_cuda_devices()[:1]]
    metafunc.parametrize("device", names, indirect=True)


@pytest.fixture
def device(request: pytest.FixtureRequest) -> wp.Device:
    """The device to test on; see `pytest_generate_tests`."""
    from resfit.kernels.runtime.launch import choose_device

    return choose_device(request.param)


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers that are the same in every run."""
    return np.random.default_rng(20240229)


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """One headless Chromium for all tests that need one."""
    playwright = pytest.importorskip("playwright.sync_api", reason="the playwright package is not installed")
    with playwright.sync_playwright() as driver:
        own = driver.chromium.executable_path
        found = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
        executable = found or (own if Path(own).exists() else None)
        if executable is None:
            pytest.skip("no Chromium is installed (apt-get install chromium)")
        browser = driver.chromium.launch(executable_path=executable, args=CHROMIUM_FLAGS)
        yield browser
        browser.close()


@pytest.fixture
def opened(browser: Browser, tmp_path: Path) -> Iterator[Callable[..., Page]]:
    """Opens the page of an assembly; afterwards nothing may have been logged, and nothing asked for but the file.

    Called with the assembly; `script` runs before the page's own, `context` goes to the browser, the rest to
    write_html.
    """
    problems, contexts = [], []

    def open_page(
        assembly: Any, script: str = "", context: dict[str, Any] | None = None, **options: Any
    ) -> Page:
        from pages import HEIGHT, SIDEBAR, WIDTH

        from resfit.exports.html import write_html

        path = tmp_path / "page.html"
        write_html(assembly, path, **options)
        size = {"width": SIDEBAR + WIDTH, "height": HEIGHT}
        made = browser.new_context(**{"viewport": size, **(context or {})})
        contexts.append(made)
        page = made.new_page()
        # Warnings may be about the software renderer's speed.
        page.on("console", lambda message: problems.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.on(
            "request", lambda request: None if request.url == path.as_uri() else problems.append(request.url)
        )
        if script:
            page.add_init_script(script)
        page.goto(path.as_uri())
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert problems == []
