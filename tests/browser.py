"""A real Chromium, and what tests do with pages of sliders."""

from __future__ import annotations

import os
import shutil
import threading
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, ElementHandle, Page, sync_playwright

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")
SCREENS: dict[str, dict[str, Any]] = {
    "wide": {"viewport": {"width": 1280, "height": 900}},
    "phone": {"viewport": {"width": 390, "height": 844}, "is_mobile": True, "has_touch": True, "color_scheme": "dark"},
}
POLICY = "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self'"

MOVE_ALL = """async ([box, known]) => {
  const SEEN = 30;  // pixels that change
  const redraws = () => performance.getEntriesByName("redraw").length;
  const after = async (act) => {
    const count = redraws();
    act();
    for (let k = 0; k < 4000 && redraws() === count; k++) await new Promise((done) => setTimeout(done));
  };
  const copies = new Map();
  const picture = () => [...document.querySelectorAll("#lab canvas, .live-block canvas")].map((each) => {
    if (!copies.has(each)) copies.set(each, new OffscreenCanvas(1, 1));
    const copy = copies.get(each);
    [copy.width, copy.height] = [each.width, each.height];
    const context = copy.getContext("2d", { willReadFrequently: true });
    context.drawImage(each, 0, 0);
    return context.getImageData(0, 0, copy.width, copy.height).data;
  });
  const changed = (before) => picture().reduce((sum, now, k) => {
    const old = before[k];
    for (let i = 0; i < now.length; i += 4) {
      sum += [0, 1, 2, 3].reduce((size, c) => size + Math.abs(now[i + c] - old[i + c]), 0) > 90;
    }
    return sum;
  }, 0) >= SEEN;
  const still = [], first = picture();
  await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
  if (changed(first)) return ["the figure moves by itself"];
  for (const input of box.querySelectorAll(".slider input[type=range], .check input")) {
    const before = picture(), value = Number(input.value);
    const name = input.closest(".slider, .check").querySelector("b").textContent;
    if (known.includes(name)) continue;
    if (input.type === "checkbox") {
      await after(() => input.click());
      if (!changed(before)) still.push(name);
      await after(() => input.click());
      continue;
    }
    let moved = false;
    for (const to of [value > 500 ? value - 250 : value + 250, 100, 650, 900, 0, 350, 1000]) {
      input.value = to;
      await after(() => input.dispatchEvent(new Event("input")));
      if ((moved = changed(before))) break;
    }
    if (!moved) still.push(name);
    const reset = input.closest(".slider").querySelector(".reset");
    await after(() => reset.click());
    if (!reset.disabled || Math.abs(input.value - value) > 1) still.push(name + " after reset");
  }
  return still;
}"""


@contextmanager
def chromium() -> Iterator[Browser]:
    """Start Chromium."""
    sandbox = ["--no-sandbox"] if os.getuid() == 0 else []  # which Chromium does not have for root
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=sandbox)
        yield browser
        browser.close()


@contextmanager
def opened(browser: Browser, address: str, screen: str = "wide", **more: Any) -> Iterator[tuple[Page, list[str]]]:
    """Open a page, and note all requests and messages: there must be no message."""
    context = browser.new_context(**{**SCREENS[screen], **more})
    page = context.new_page()
    requests: list[str] = []
    messages: list[str] = []
    page.on("request", lambda request: requests.append(request.url))
    page.on("console", lambda message: messages.append(message.text))
    page.on("pageerror", lambda error: messages.append(str(error)))
    page.goto(address)
    yield page, requests
    assert messages == []
    context.close()


def idle_controls(page: Page, box: ElementHandle | None = None, known: Collection[str] = ()) -> list[str]:
    """Move each control of a page, or of a part of it; return the names of those that change no figure visibly.

    Those that are known to change one are left out.
    """
    found = page.evaluate(MOVE_ALL, [box or page.query_selector("body"), [*known]])
    return [str(name) for name in found]


def objections(page: Page) -> list[tuple[str, str]]:
    """What axe objects to: the rule, and the first element."""
    found = Axe().run(page).response
    assert len(found["passes"]) > 15
    return [(rule["id"], rule["nodes"][0]["html"]) for rule in found["violations"]]


@contextmanager
def served(folder: Path, policy: str = POLICY) -> Iterator[str]:
    """Serve a folder under a content-security policy; the address ends with a slash."""

    class Handler(SimpleHTTPRequestHandler):
        def end_headers(self) -> None:
            self.send_header("Content-Security-Policy", policy)
            super().end_headers()

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Handler, directory=str(folder)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/"
    server.shutdown()
    server.server_close()
