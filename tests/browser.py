"""A headless Chromium, driven through its DevTools pipe: messages are JSON, each ended by a zero byte."""

import base64
import json
import os
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any

MISSING = "no Chromium is installed (on Debian: apt-get install chromium): the page is not tried in a browser"
FLAGS = (
    "--headless=new", "--no-sandbox", "--no-first-run", "--disable-gpu-sandbox", "--hide-scrollbars",
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage",
    "--remote-debugging-pipe", "--disable-extensions", "--disable-background-networking",
    "--proxy-server=http://127.0.0.1:9",  # no network: whatever asks for it fails
)  # fmt: skip


def find_chromium() -> str | None:
    """The path of a Chromium or Chrome, or None."""
    return next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


class Browser:
    """One page in a headless Chromium, drawn by its software renderer.

    Args:
        profile: an empty folder for the browser.
        width: of the page, pixels.
        height: of the page, pixels.
    """

    def __init__(self, profile: Path, width: int = 1100, height: int = 760) -> None:
        chromium = find_chromium()
        assert chromium, MISSING
        theirs_in, self._out = os.pipe()
        self._in, theirs_out = os.pipe()
        command = [
            chromium,
            *FLAGS,
            f"--user-data-dir={profile}",
            f"--window-size={width},{height}",
            "about:blank",
        ]
        pipes = f'exec "$@" 3<&{theirs_in} 4>&{theirs_out} 2>/dev/null'
        self.process = subprocess.Popen(
            ["bash", "-c", pipes, "bash", *command], pass_fds=(theirs_in, theirs_out)
        )
        os.close(theirs_in)
        os.close(theirs_out)
        self._buffer, self._number, self.messages = b"", 0, []
        self._session: str | None = None
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **size)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Result of a method of the DevTools protocol; events that come meanwhile are kept in `messages`."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._read()
            if answer.get("id") == self._number:
                assert "error" not in answer, f"{method}: {answer['error']}"
                return answer["result"]
            self.messages.append(answer)

    def open(self, path: Path) -> None:
        """Opens a file and waits until its player is there."""
        self.call("Page.navigate", url=path.as_uri())
        self.wait_for("document.readyState === 'complete' && Boolean(window.player)")

    def evaluate(self, expression: str) -> Any:
        """Value of a JavaScript expression, or of what it promises."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait_for(self, expression: str, seconds: float = 60.0) -> None:
        """Waits until an expression holds."""
        end = time.monotonic() + seconds
        while not self.evaluate(expression):
            assert time.monotonic() < end, f"{expression} did not come true in {seconds} s"
            time.sleep(0.05)

    def press(self, key: str, shift: bool = False) -> None:
        """Presses and releases a key."""
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, modifiers=8 if shift else 0)

    def mouse(self, kind: str, x: float, y: float, **more: Any) -> None:
        """A mouse event at a place on the page."""
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def screenshot(self, path: Path) -> None:
        """Writes what is seen, after the next frame, as PNG."""
        self.evaluate(
            "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(1))))"
        )
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))

    def complaints(self) -> list[str]:
        """Errors of scripts and of the log so far, and every address that was asked for."""
        found = []
        for message in self.messages:
            kind, parameters = message.get("method"), message.get("params", {})
            if kind == "Runtime.exceptionThrown" or (
                kind == "Log.entryAdded" and parameters["entry"]["level"] == "error"
            ):
                found.append(json.dumps(parameters))
            if kind == "Network.requestWillBeSent" and parameters["request"]["url"].startswith("http"):
                found.append(parameters["request"]["url"])
        return found

    def close(self) -> None:
        """Ends the browser."""
        self.process.terminate()
        self.process.wait(20)
        os.close(self._in)
        os.close(self._out)

    def _read(self) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            piece = os.read(self._in, 1 << 20)
            assert piece, "Chromium has ended"
            self._buffer += piece
        message, _, self._buffer = self._buffer.partition(b"\0")
        return json.loads(message)
