"""A hostile page in a real browser, beside the live page: what it tries, and what comes of it.

    python hostile_page.py ADDRESS CONNECTIONS

`ADDRESS` is that of a live view, token included: the page is told more than an attacker would know.
Prints a table of outcomes as JSON. A process of its own: two of playwright's drivers do not share
one.
"""

import contextlib
import http.server
import json
import shutil
import sys
import threading
import time

from playwright.sync_api import Error, sync_playwright

FLAGS = [
    "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--enable-unsafe-swiftshader",
    "--disable-popup-blocking",
    # A name that an attacker makes resolve to this machine; nothing else resolves at all.
    "--host-resolver-rules=MAP evil.example 127.0.0.1, MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
]  # fmt: skip
# Whether the live page is in a document.
SHOWN = "document.getElementById('meshcat-pane') !== null"
PAGE = b"""<!DOCTYPE html><title>hostile</title><body><script>
const outcomes = {};
const after = (ms) => new Promise((done) => setTimeout(() => done("nothing"), ms));
async function attempt(name, action) {
  outcomes[name] = await Promise.race([action().catch((error) => "refused"), after(2500)]);
}
const socket = (address, words) => () => new Promise((done) => {
  const link = new WebSocket(address);
  link.onopen = () => { for (const word of words) link.send(word); done("open"); };
  link.onerror = () => done("refused");
});
const element = (tag, attributes) => () => new Promise((done) => {
  const thing = document.createElement(tag);
  thing.onload = () => done("loaded");
  thing.onerror = () => done("refused");
  Object.assign(thing, attributes);
  document.body.append(thing);
});
async function attack([address, most]) {
  const base = new URL(address).origin, ws = base.replace("http", "ws");
  const read = async (...rest) => (await (await fetch(...rest)).text()).length ? "read" : "empty";
  await Promise.all([
    attempt("read the root", () => read(base + "/")),
    attempt("read with the token", () => read(address)),
    attempt("post blindly", async () =>
      (await fetch(base + "/", {method: "POST", mode: "no-cors", body: "x".repeat(1e7)})).type),
    attempt("socket", socket(ws + "/frames", ["q"])),
    attempt("socket at the root", socket(ws + "/", ["q"])),
    attempt("socket with the token", socket(address.replace("http", "ws") + "frames", ["q"])),
    attempt("script", element("script", {src: address})),
    attempt("picture", element("img", {src: address})),
    attempt("style", element("link", {rel: "stylesheet", href: address})),
    attempt("worker", async () => (new Worker(address), "made")),
    attempt("window", async () => {
      const other = window.open(address);
      if (!other) return "refused";
      await after(800);
      // Cut off from the window that it opened, as it asks to be.
      return other.closed ? "cut off" : other.document.title;
    }),
  ]);
  const form = document.createElement("form");
  Object.assign(form, {method: "POST", action: base + "/", target: "sink"});
  const sink = document.createElement("iframe");
  sink.name = "sink";
  document.body.append(sink, form);
  form.submit();
  const frame = document.createElement("iframe");
  Object.assign(frame, {src: address, id: "stolen"});
  document.body.append(frame);
  // More connections than a browser makes at a time.
  for (let k = 0; k < most; k++) {
    new WebSocket(ws + "/frames");
    fetch(base + "/" + k, {mode: "no-cors"}).catch(() => null);
  }
  await after(1500);
  return outcomes;
}
</script>"""


class Attacker(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.send_header("Content-Length", str(len(PAGE)))
        self.end_headers()
        self.wfile.write(PAGE)

    def log_message(self, *words):
        pass


def until(page, expression):
    """Wait for an expression, from outside: the page forbids evaluating strings within it."""
    limit = time.monotonic() + 120.0
    while not page.evaluate(expression):
        assert time.monotonic() < limit, expression
        page.wait_for_timeout(50)


def main(address, most):
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Attacker)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    found = {}
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=path, args=FLAGS)
        own = browser.new_page()
        own.goto(address)
        until(own, "window.fpidPin && fpidPin.frames() > 3")
        # A name of the attacker's that now means this machine: the same origin, for the browser.
        rebound = browser.new_page()
        statuses = []
        rebound.on("response", lambda answer: statuses.append(answer.status))
        with contextlib.suppress(Error):
            rebound.goto(address.replace("127.0.0.1", "evil.example"))
        found["rebound name"] = statuses
        page = browser.new_page()
        page.goto(f"http://evil.example:{server.server_address[1]}/")
        found |= page.evaluate("(given) => attack(given)", [address, most])
        inside = [frame for frame in page.frames if frame.parent_frame and frame.name != "sink"]
        found["frame"] = [frame.evaluate(SHOWN) for frame in inside]
        before = own.evaluate("fpidPin.frames()")
        until(own, f"fpidPin.frames() > {before + 3}")
        found["frames meanwhile"] = own.evaluate("fpidPin.frames()") - before
        own.keyboard.press("q")
        until(own, "!document.getElementById('message').hidden")
        browser.close()
    server.shutdown()
    sys.stdout.write(json.dumps(found) + "\n")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
