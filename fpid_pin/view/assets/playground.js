"use strict";
// The page: a setting moves, the worker runs, everything is drawn anew.
const worker = new Worker(URL.createObjectURL(
  new Blob([element("engine").textContent], {type: "text/javascript"})));
const stage = new ArmView(element("stage"));
const plots = Object.fromEntries(["error", "torque", "signal"].map((name) =>
  [name, new Plot(element(`plot-${name}`))]));
const state = {runs: null, pinned: null, got: 0, busy: false, waiting: false, latency: []};

function say(text, bad = false) {
  element("message").textContent = text;
  element("message").hidden = !text;
  element("message").classList.toggle("bad", bad);
}

// ------------------------------------------------------------------ settings and their past

const model = {
  now: fresh(), pinned: null, past: [], future: [], committed: null,
  // `final`: the hand has let go, which is what undo goes back to.
  change(some, final) {
    Object.assign(this.now, some);
    if (final) this.commit();
    refresh();
    ask();
  },
  commit() {
    const snapshot = JSON.stringify([this.now, this.pinned]);
    if (snapshot === this.committed) return;
    if (this.committed !== null) this.past.push(this.committed);
    this.past.splice(0, this.past.length - 200);
    this.committed = snapshot;
    this.future = [];
    remember();
  },
  go(from, to) {
    if (!from.length) return;
    to.push(this.committed);
    this.committed = from.pop();
    this.load(...JSON.parse(this.committed));
  },
  load(now, pinned) {
    this.pinned = pinned;
    this.change(now, false);
    remember();
  },
};

function remember() {
  try {
    // Without "#" where nothing differs: it would scroll a page that holds this one to here.
    const link = toLink(model.now, model.pinned);
    history.replaceState(null, "", link ? `#${link}` : location.pathname + location.search);
  } catch {
    // A page inside another has no address of its own; its link button still has one to copy.
  }
}

// ------------------------------------------------------------------ runs

// One message at a time; of those that were asked for meanwhile only the newest.
function ask() {
  clearTimeout(state.scene);
  Object.assign(state, {asked: performance.now(), waiting: true});
  if (!state.busy) send();
}
function send() {
  const {now, pinned} = model;
  const runs = [...new Set([now.controller, ...now.beside])].map((law) => settingsOf(now, law));
  Object.assign(state, {busy: true, waiting: false, sent: state.asked, hasPinned: pinned !== null});
  if (pinned) runs.push(settingsOf(pinned, pinned.controller));
  document.body.classList.add("busy");
  worker.postMessage({runs, signal: element("signal-name").value});
}
worker.onmessage = ({data: {runs, fault}}) => {
  state.busy = false;
  if (fault) say(`The engine stopped: ${fault}`, true);
  else {
    state.pinned = state.hasPinned ? runs.pop() : null;
    state.runs = runs;
    draw();
    state.latency.push(performance.now() - state.sent);
    state.got += 1;
  }
  document.body.classList.toggle("busy", state.waiting);
  if (state.waiting) send();
};
worker.onerror = (event) => say(`The engine could not start: ${event.message}`, true);

// ------------------------------------------------------------------ what is seen

const total = (...x) => x.reduce((a, b) => a + b);
const METRICS = [
  ["rms", "error, rms", "rad", Math.max], ["rms_tail", "… second half", "rad", Math.max],
  ["iae", "∫|e| dt", "rad s", total], ["peak_torque", "largest torque", "N m", Math.max],
  ["energy", "∫u² dt", "N²m²s", total], ["total_variation", "torque's ups and downs", "N m", total]];

const several = () => model.now.beside.length > 0;
const chosen = () => (element("joint").value === "all" ? [...JOINTS.keys()] : [Number(element("joint").value)]);

function table() {
  const {runs, pinned} = state, all = [...runs, ...(pinned ? [pinned] : [])], joints = chosen();
  const names = runs.map(({controller}) => (several() ? PAGE.laws[controller].name : "now"));
  // Two runs: by how much the first is better or worse. More: the best of them.
  const head = ["the smaller the better", ...names, ...(pinned ? ["pinned"] : []),
    ...(all.length === 2 ? ["change"] : [])];
  element("metrics-head").replaceChildren(...head.map((text) => make("th", {scope: "col"}, text)));
  element("metrics").replaceChildren(...METRICS.map(([metric, text, unit, gather]) => {
    const units = [...new Set(joints.map((j) => PAGE.units[j][unit]))].join(" or ");
    const values = all.map((run) => gather(...joints.map((j) => run.metrics[metric][j])));
    const [now, other] = values, change = (100 * (now - other)) / other, best = Math.min(...values);
    const cells = values.map((x) => make("td", {class: values.length > 2 && x === best ? "better" : ""},
      Number.isFinite(x) ? label(tidy(x, 3)) : "–"));
    if (values.length === 2) {
      const kind = Math.abs(change) < 0.05 ? "" : change < 0 ? "better" : "worse";
      const said = `${change > 0 ? "+" : "−"}${label(tidy(Math.abs(change), 2))} %`;
      cells.push(make("td", {class: kind}, !Number.isFinite(change) ? "–" : kind ? said : "0 %"));
    }
    return make("tr", {}, make("th", {scope: "row"}, text, make("small", {}, units)), ...cells);
  }));
}

function draw() {
  const {runs, pinned} = state;
  if (!runs) return;
  for (const [name, plot] of Object.entries(plots)) {
    const curves = (run, dashed) => (run?.plots[name] ? chosen().map((j) => ({
      values: run.plots[name][j], kind: several() ? run.controller : j, dashed,
      lost: !run.outcome.completed})) : []);
    plot.show([...curves(pinned, true), ...runs.flatMap((run) => curves(run, false))]);
  }
  table();
  // The arm comes after the curves, when a slider rests: without a graphics card it takes longer
  // than all else, and would keep the next curves waiting.
  clearTimeout(state.scene);
  state.scene = setTimeout(() => stage.show(state.runs[0].frames, state.pinned?.frames),
    stage.frames ? 150 : 0);
  const lost = runs.find(({outcome}) => !outcome.completed), box = element("outcome");
  box.className = lost ? "bad" : "good";
  const {time, joint, cause} = lost?.outcome ?? {};
  const who = several() && lost ? `${PAGE.laws[lost.controller].name}: diverged` : "Diverged";
  const spent = Math.round(total(...runs.map(({milliseconds}) => milliseconds)));
  box.textContent = lost ? `${who} at ${label(tidy(time, 5))} s, ${joint}: ${cause}.`
    : `Ran all ${label(ENGINE.duration)} s, ${runs[0].rows.toLocaleString("en")} samples, in ${spent} ms.`;
}

const option = (value, text) => make("option", {value}, text);
const key = (text, kind) => make("span", {class: "key", style: `--joint: ${colour(kind)}`}, make("i"), text);
let redraw = () => {}, built = null;
function refresh() {
  const {controller, beside} = model.now;
  if (built !== controller) {
    built = controller;
    redraw = buildControls(element("controls"), controller);
    element("controller").value = controller;
    element("signal-name").replaceChildren(...PAGE.laws[controller].signals.map((one) => option(...one)));
  }
  document.querySelectorAll("#beside input").forEach((box, k) => {
    box.checked = k === controller || beside.includes(k);
    box.disabled = k === controller;
  });
  // Laws are told apart by colour, so joints one at a time.
  element("joint").options[0].hidden = several();
  if (several() && element("joint").value === "all") element("joint").value = "0";
  element("legend").replaceChildren(
    ...(several() ? [controller, ...beside].map((k) => key(PAGE.laws[k].name, k))
      : chosen().map((j) => key(JOINTS[j], j))),
    ...(model.pinned ? [make("span", {class: "key dashed"}, make("i"), "pinned")] : []));
  redraw();
  element("undo").disabled = !model.past.length;
  element("redo").disabled = !model.future.length;
  element("reset").disabled = same({...model.now, controller: 0}, fresh());
  element("unpin").hidden = !model.pinned;
}

// ------------------------------------------------------------------ commands

// Settings that one step back undoes, and what there is to say of them.
function take(now, pinned, text) {
  model.pinned = pinned;
  model.change(now, true);
  say(text);
}

const commands = {
  undo() { model.go(model.past, model.future); },
  redo() { model.go(model.future, model.past); },
  reset() {
    take({...fresh(), controller: model.now.controller}, model.pinned, "");
    element("preset").value = "";
  },
  pin() {
    take({}, clone(model.now), "Pinned: dashed lines, the grey path, and a column of its own in the table.");
  },
  unpin() { take({}, null, ""); },
  link() { give(`${location.href.split("#")[0]}#${toLink(model.now, model.pinned)}`, "Link"); },
  toml() { give(toToml(settingsOf(model.now, model.now.controller)), "TOML"); },
  play() { stage.play(!stage.playing); },
  close() { element("giving").close(); },
  async copy() {
    element("given").select();
    const copied = await navigator.clipboard?.writeText(element("given").value).then(() => true, () => false);
    const said = copied || document.execCommand("copy") ? "Copied." : "Select and copy it.";
    element("copied").textContent = said;
  },
};
for (const [name, command] of Object.entries(commands)) {
  element(name).addEventListener("click", () => command());
}

// A text to take away: shown, so that it can be taken by hand where there is no clipboard.
function give(text, what) {
  element("given").value = text;
  element("giving-head").textContent = what;
  element("save").hidden = what !== "TOML";
  element("save").href = `data:application/toml;charset=utf-8,${encodeURIComponent(text)}`;
  element("copied").textContent = "";
  element("giving").showModal();
  element("given").setSelectionRange(0, 0);
  element("given").scrollTop = 0;
}

onSpace(commands.play);
document.addEventListener("keydown", (event) => {
  const typing = event.target.matches("input[type=text], textarea, select");
  if (typing || !(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z") return;
  event.preventDefault();
  (event.shiftKey ? commands.redo : commands.undo)();
});

// Presets, controllers, joints, signals.
const changed = (id, act) => element(id).addEventListener("change", ({target}) => act(target.value));
element("preset").append(...PAGE.presets.map(({name}, k) => option(k, name)));
changed("preset", (k) => {
  if (k === "") return;
  const {now, pinned, text} = PAGE.presets[k];
  take(fromLink(now).now, pinned === null ? null : fromLink(pinned).now, text);
});
PAGE.laws.forEach(({name}, k) => {
  element("controller").append(option(k, name));
  const box = make("input", {type: "checkbox"});
  box.addEventListener("change", () => model.change({beside: box.checked
    ? [...model.now.beside, k] : model.now.beside.filter((other) => other !== k)}, true));
  element("beside").append(make("label", {}, box, name));
});
for (const id of ["laws", "beside"]) element(id).hidden = PAGE.laws.length < 2;
changed("controller", (value) => {
  const controller = Number(value), {beside, controller: before} = model.now;
  model.change({controller, beside: several()
    ? [before, ...beside].filter((k) => k !== controller) : []}, true);
});
element("joint").append(option("all", "all joints"), ...JOINTS.map((name, j) => option(j, name)));
changed("joint", () => {
  refresh();
  draw();
});
changed("signal-name", ask);
dark.addEventListener("change", () => {
  built = null;
  Object.values(plots).forEach((plot) => plot.build());
  refresh();
});

// Time: one for the arm and all plots.
const seek = element("seek");
seek.max = ENGINE.duration;
stage.moved = () => {
  const {time, playing} = stage, text = `${time.toFixed(2)} s`;
  if (document.activeElement !== seek || playing) seek.value = time;
  seek.setAttribute("aria-valuetext", text);
  element("time").textContent = text;
  element("play").textContent = playing ? "Pause" : "Play";
  Object.values(plots).forEach(({chart}) => chart.redraw(false, false));
};
seek.addEventListener("input", () => {
  stage.play(false);
  stage.seek(Number(seek.value));
});

function open() {
  const {now, pinned, faults} = fromLink(location.hash.slice(1));
  if (state.asked && toLink(now, pinned) === toLink(model.now, model.pinned)) return;
  model.load(now, pinned);
  model.commit();
  if (faults.length) say(`The link was not understood: ${faults.join("; ")}.`, true);
}
open();
window.addEventListener("hashchange", open);
stage.play(!reduced.matches);
window.playground = {model, state};
