"use strict";
// The page: a setting moves, the worker runs, everything is drawn anew.
const element = (id) => document.getElementById(id);
const worker = new Worker(URL.createObjectURL(
  new Blob([element("engine").textContent], {type: "text/javascript"})));
const stage = new Stage(element("stage"));
const plots = {
  error: new Plot(element("plot-error")), torque: new Plot(element("plot-torque")),
  gains: new Plot(element("plot-gains"))};
const state = {now: null, pinned: null, sent: 0, got: 0, busy: false, waiting: null, latency: []};

function say(text, bad = false) {
  const box = element("message");
  box.textContent = text;
  box.hidden = !text;
  box.classList.toggle("bad", bad);
}

// ------------------------------------------------------------------ settings and their past

const model = {
  now: fresh(), pinned: null, past: [], future: [], committed: null,
  snapshot() { return JSON.stringify([this.now, this.pinned]); },
  // `final`: the hand has let go, which is what undo goes back to.
  change(some, final) {
    Object.assign(this.now, some);
    if (final) this.commit();
    refresh();
    ask(this.now, "now");
  },
  commit() {
    const snapshot = this.snapshot();
    if (snapshot === this.committed) return;
    if (this.committed !== null) this.past.push(this.committed);
    if (this.past.length > 200) this.past.shift();
    this.committed = snapshot;
    this.future = [];
    remember();
    buttons();
  },
  go(from, to) {
    if (!from.length) return;
    to.push(this.committed);
    this.committed = from.pop();
    this.load(...JSON.parse(this.committed));
  },
  load(now, pinned) {
    const repin = !same(pinned, this.pinned);
    [this.now, this.pinned] = [now, pinned];
    if (repin) {
      state.pinned = null;
      if (pinned) ask(pinned, "pinned");
    }
    remember();
    refresh();
    ask(this.now, "now");
  },
};

function remember() {
  const link = toLink(model.now, model.pinned);
  try {
    history.replaceState(null, "", `#${link}`);
  } catch {
    // A page inside another has no address of its own; its link button still has one to copy.
  }
}

// ------------------------------------------------------------------ runs

// One run at a time; of those that were asked for meanwhile only the newest.
const queue = {now: null, pinned: null};
const answers = new Map();
function ask(settings, role, whole = false) {
  clearTimeout(state.scene);
  queue[role] = {settings: clone(settings), role, whole, asked: performance.now()};
  pump();
}
function pump() {
  if (state.busy) return;
  const next = queue.pinned ?? queue.now;
  if (!next) return;
  queue[next.role] = null;
  state.busy = true;
  state.sent += 1;
  answers.set(state.sent, next);
  document.body.classList.add("busy");
  worker.postMessage({id: state.sent, settings: next.settings, whole: next.whole});
}
worker.onmessage = ({data}) => {
  const asked = answers.get(data.id);
  answers.delete(data.id);
  state.busy = false;
  if (data.fault) say(`The engine stopped: ${data.fault}`, true);
  else {
    state[asked.role] = {...data, settings: asked.settings};
    const start = performance.now();
    if (asked.role === "now" || state.now) draw();
    state.drawing = performance.now() - start;
    if (asked.role === "now") {
      state.latency.push(performance.now() - asked.asked);
      state.got += 1;
    }
  }
  document.body.classList.toggle("busy", Boolean(queue.now ?? queue.pinned));
  pump();
};
worker.onerror = (event) => say(`The engine could not start: ${event.message}`, true);

// ------------------------------------------------------------------ what is seen

const METRICS = [
  ["rms", "error, rms", "rad", Math.max], ["rms_tail", "… second half", "rad", Math.max],
  ["iae", "∫|e| dt", "rad s", (...x) => x.reduce((a, b) => a + b)],
  ["peak_torque", "largest torque", "N m", Math.max],
  ["energy", "∫u² dt", "N²m²s", (...x) => x.reduce((a, b) => a + b)],
  ["total_variation", "torque's ups and downs", "N m", (...x) => x.reduce((a, b) => a + b)]];

const chosen = () => {
  const value = element("joint").value;
  return value === "all" ? JOINTS.map((_, j) => j) : [Number(value)];
};

function table() {
  const body = element("metrics"), joints = chosen();
  body.replaceChildren();
  for (const [key, text, unit, gather] of METRICS) {
    const of = (run) => (run ? gather(...joints.map((j) => run.metrics[key][j])) : null);
    const now = of(state.now), pinned = of(state.pinned), row = body.insertRow();
    row.append(make("th", {scope: "row"}, text, make("small", {}, unit)));
    const cell = (text_, kind = "") => row.append(make("td", {class: kind}, text_));
    const word = (x) => (x === null ? "–" : Number.isFinite(x) ? label(tidy(x, 3)) : "–");
    cell(word(now));
    cell(word(pinned));
    const change = pinned ? (100 * (now - pinned)) / pinned : NaN;
    const small = Math.abs(change) < 0.05;
    cell(!Number.isFinite(change) ? "–" : small ? "0 %" : `${change > 0 ? "+" : "−"}${
      label(tidy(Math.abs(change), 2))} %`,
      Number.isFinite(change) && !small ? (change < 0 ? "better" : "worse") : "");
  }
}

function draw() {
  const {now, pinned} = state;
  if (!now) return;
  const joints = chosen(), lost = !now.outcome.completed;
  const gain = element("gain").value, of = (run, name) => run?.plots[name] ?? null;
  plots.error.show(of(now, "error"), of(pinned, "error"), joints, lost);
  plots.torque.show(of(now, "torque"), of(pinned, "torque"), joints, lost);
  plots.gains.show(of(now, gain), of(pinned, gain), joints, lost);
  table();
  // The arm comes after the curves, when a slider rests: without a graphics card it takes longer
  // than all else, and would keep the next curves waiting.
  clearTimeout(state.scene);
  state.scene = setTimeout(() => stage.show(state.now.frames, state.pinned?.frames),
    stage.frames ? 150 : 0);
  const {outcome} = now, box = element("outcome");
  box.className = lost ? "bad" : "good";
  box.textContent = lost
    ? `Diverged at ${label(tidy(outcome.time, 5))} s, ${outcome.joint}: ${outcome.cause}.`
    : `Ran all ${label(ENGINE.duration)} s, ${now.rows.toLocaleString("en")} samples, in ${
      Math.round(now.milliseconds)} ms.`;
}

let redraw = () => {};
function refresh() {
  redraw();
  buttons();
}

function buttons() {
  element("undo").disabled = !model.past.length;
  element("redo").disabled = !model.future.length;
  element("reset").disabled = same(model.now, fresh(model.now.controller));
  element("unpin").hidden = !model.pinned;
}

// ------------------------------------------------------------------ commands

const commands = {
  undo() { model.go(model.past, model.future); },
  redo() { model.go(model.future, model.past); },
  reset() {
    model.now = fresh(model.now.controller);
    model.commit();
    refresh();
    ask(model.now, "now");
    say("");
    element("preset").value = "";
  },
  pin() {
    model.pinned = clone(model.now);
    model.commit();
    ask(model.pinned, "pinned");
    say("Pinned: dashed lines, the grey path, and the table's second column.");
  },
  unpin() {
    model.pinned = state.pinned = null;
    model.commit();
    draw();
    buttons();
    say("");
  },
  link() { give(`${location.href.split("#")[0]}#${toLink(model.now, model.pinned)}`, "Link"); },
  toml() { give(toToml(model.now), "TOML"); },
};
for (const [name, command] of Object.entries(commands)) {
  element(name).addEventListener("click", () => command());
}
element("play").addEventListener("click", () => stage.play(!stage.playing));

// A text to take away: shown, so that it can be taken by hand where there is no clipboard.
function give(text, what) {
  element("given").value = text;
  element("giving").querySelector("h2").textContent = what;
  element("save").hidden = what !== "TOML";
  element("copied").textContent = "";
  element("giving").showModal();
  element("given").setSelectionRange(0, 0);
  element("given").scrollTop = 0;
}
element("copy").addEventListener("click", async () => {
  const text = element("given");
  try {
    await navigator.clipboard.writeText(text.value);
    element("copied").textContent = "Copied.";
  } catch {
    text.select();
    element("copied").textContent = document.execCommand("copy") ? "Copied." : "Select and copy it.";
  }
});
element("save").addEventListener("click", () => {
  const blob = new Blob([element("given").value], {type: "application/toml"});
  const a = make("a", {href: URL.createObjectURL(blob), download: "playground.toml"});
  a.click();
  URL.revokeObjectURL(a.href);
});
element("close").addEventListener("click", () => element("giving").close());

document.addEventListener("keydown", (event) => {
  const typing = event.target.matches("input[type=text], textarea, select");
  if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "z" && !typing) {
    event.preventDefault();
    (event.shiftKey ? commands.redo : commands.undo)();
  } else if (event.key === " " && event.target === document.body) {
    event.preventDefault();
    stage.play(!stage.playing);
  }
});

// Presets and controllers.
const preset = element("preset");
PAGE.presets.forEach(({name}, k) => preset.append(make("option", {value: k}, name)));
preset.addEventListener("change", () => {
  const {now, pinned, text} = PAGE.presets[preset.value] ?? {};
  if (!now) return;
  model.load({...fresh(now.controller ?? 0), ...clone(now)},
    pinned ? {...fresh(pinned.controller ?? 0), ...clone(pinned)} : null);
  model.commit();
  say(text);
});
const law = element("controller");
PAGE.names.forEach((name, k) => law.append(make("option", {value: k}, name)));
element("laws").hidden = PAGE.names.length < 2;
law.addEventListener("change", () => {
  const start = fresh(Number(law.value)), mine = ["integral_order", "derivative_order", "kp", "ki",
    "kd", "learning_rate", "order_learning_rate", "k0", "k1", "sigma", "dead_zone", "supervised", "m_x",
    "controller"];
  model.change(Object.fromEntries(mine.map((key) => [key, start[key]])), true);
});

// The choice of joints, which is the plots' legend.
const joint = element("joint");
joint.append(make("option", {value: "all"}, "all joints"));
JOINTS.forEach((name, j) => joint.append(make("option", {value: j}, name)));
joint.addEventListener("change", draw);
element("gain").addEventListener("change", draw);
JOINTS.forEach((name, j) => {
  const key = make("span", {class: "key"}, make("i"), name);
  key.style.setProperty("--joint", `var(--joint-${j % 7})`);
  element("legend").append(key);
});
function colours() {
  const palette = dark.matches ? DARK : LIGHT;
  palette.forEach((c, j) => document.documentElement.style.setProperty(`--joint-${j}`, c));
}
colours();
dark.addEventListener("change", () => {
  colours();
  Object.values(plots).forEach((plot) => plot.build());
  draw();
});

// Time: one for the arm and all plots.
const seek = element("seek");
seek.max = ENGINE.duration;
stage.moved = (t) => {
  if (document.activeElement !== seek || stage.playing) seek.value = t;
  seek.setAttribute("aria-valuetext", `${t.toFixed(2)} s`);
  element("time").textContent = `${t.toFixed(2)} s`;
  for (const plot of Object.values(plots)) {
    plot.time = t;
    plot.chart.redraw(false, false);
  }
};
seek.addEventListener("input", () => {
  stage.play(false);
  stage.seek(Number(seek.value));
});
stage.toggled = (on) => {
  element("play").textContent = on ? "Pause" : "Play";
};

// On a narrow screen one view at a time, above the sliders.
const tabs = [...document.querySelectorAll("[role=tab]")];
function show(tab) {
  tabs.forEach((one) => {
    one.setAttribute("aria-selected", String(one === tab));
    one.tabIndex = one === tab ? 0 : -1;
  });
  document.body.dataset.view = tab.dataset.view;
}
tabs.forEach((tab, k) => {
  tab.addEventListener("click", () => show(tab));
  tab.addEventListener("keydown", ({key}) => {
    const next = {ArrowRight: k + 1, ArrowLeft: k - 1}[key];
    if (next === undefined) return;
    const to = tabs[(next + tabs.length) % tabs.length];
    show(to);
    to.focus();
  });
});
show(tabs[0]);

redraw = buildControls(element("controls"));
const linked = fromLink(location.hash.slice(1));
law.value = linked.now.controller;
const refreshed = redraw;
redraw = () => {
  law.value = model.now.controller;
  refreshed();
};
model.load(linked.now, linked.pinned);
model.commit();
if (linked.faults.length) say(`The link was not understood: ${linked.faults.join("; ")}.`, true);
else if (PAGE.notes.length) say(PAGE.notes.join(" "));
window.addEventListener("hashchange", () => {
  const again = fromLink(location.hash.slice(1));
  if (toLink(again.now, again.pinned) === toLink(model.now, model.pinned)) return;
  model.load(again.now, again.pinned);
  model.commit();
});
if (reduced.matches) stage.toggled(false); else stage.play(true);
window.playground = {model, state, ask, toToml, toLink, fromLink, stage, plots, commands};
