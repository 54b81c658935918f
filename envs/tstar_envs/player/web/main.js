// The page: one pane for each of two episodes, one clock and one camera for both, keys, and `window.player`.

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];
const find = (id) => document.getElementById(id);
const content = JSON.parse(find("content").textContent);
const episodes = content.episodes.map((plain) => new Recording(plain, content.scene.bodies));
const last = Math.max(...episodes.map((episode) => episode.steps));
const clock = { time: 0, speed: 2, playing: false, before: null };

function made(tag, parent, properties = {}) {
  const element = Object.assign(document.createElement(tag), properties);
  parent.append(element);
  return element;
}

function picture(tag, parent, label) {
  const element = made(tag, parent);
  element.setAttribute("role", "img");
  element.setAttribute("aria-label", label);
  return element;
}

// Who chose with the pointer has the player's keys again; who chose with keys goes on choosing.
function chooses(select, choose) {
  let pointed = false;
  select.addEventListener("pointerdown", () => { pointed = true; });
  select.addEventListener("keydown", () => { pointed = false; });
  select.addEventListener("change", () => {
    choose(+select.value);
    if (pointed) select.blur();
  });
}

function describe(episode) {
  const state = episode.state(clock.time);
  const count = content.subtaskCount;
  const parts = [`step ${state.step} of ${episode.steps}`];
  if (state.subtask >= count) parts.push("all subtasks done");
  else {
    parts.push(`subtask ${state.subtask + 1} of ${count}${content.subtasks.length ? `: ${content.subtasks[state.subtask]}` : ""}`);
    parts.push(`phase ${content.phases[state.phase] ?? state.phase}`);
  }
  if (state.reward !== null) parts.push(`reward ${state.reward.toFixed(1)}`);
  for (const [name, value] of Object.entries(state.series)) parts.push(`last ${name} ${value === null ? "-" : value.toFixed(2)}`);
  return parts.join(" · ");
}

class Pane {
  constructor(index) {
    const section = made("section", find("panes"));
    const header = made("header", section);
    this.title = episodes.length > 2 ? made("select", header) : made("h2", header);
    this.outcome = made("span", header, { className: "outcome" });
    const frame = made("div", section, { className: "view" });
    try {
      this.view = new View(picture("canvas", frame, "The scene"), content.scene);
      camera.follow(frame);
    } catch (error) {
      made("p", frame, { textContent: error.message });
    }
    const rows = picture("canvas", section, "Subtask, phase, reward and further series over the steps");
    this.timeline = new Timeline(Object.assign(rows, { className: "timeline" }), last, seek);
    this.readout = made("p", section, { className: "readout" });
    if (episodes.length > 2) {
      episodes.forEach((episode, i) => made("option", this.title, { value: i, textContent: episode.title }));
      chooses(this.title, (chosen) => this.show(chosen));
      this.title.setAttribute("aria-label", "Episode");
    }
    this.show(index);
  }

  show(index) {
    this.episode = episodes[index];
    if (episodes.length > 2) this.title.value = index;
    else this.title.textContent = this.episode.title;
    this.outcome.textContent = this.episode.success ? "success" : "failure";
    this.outcome.className = `outcome ${this.episode.success ? "good" : "bad"}`;
    redraw();
  }

  draw() {
    const time = Math.min(clock.time, this.episode.steps);
    this.view?.draw(this.episode.at(time), camera);
    this.timeline.draw(this.episode, time, content);
    this.readout.textContent = describe(this.episode);
  }
}

let asked = false;
function redraw() {
  if (asked) return;
  asked = true;
  requestAnimationFrame((now) => {
    asked = false;
    advance(now);
    panes.forEach((pane) => pane.draw());
    find("scrub").value = clock.time;
    find("play").textContent = clock.playing ? "Pause" : "Play";
    find("speed").value = clock.speed;
    if (clock.playing) redraw();
  });
}

function advance(now) {
  if (clock.playing && clock.before !== null) {
    const passed = Math.min(now - clock.before, 100); // ms: no frames are asked for while the page is hidden
    clock.time += (passed / 1000) * (clock.speed / content.stepSeconds);
    if (clock.time >= last) Object.assign(clock, { time: last, playing: false });
  }
  clock.before = clock.playing ? now : null;
}

function play(on = true) {
  if (on && clock.time >= last) clock.time = 0;
  clock.playing = on;
  redraw();
}

function seek(time) {
  clock.time = Math.min(Math.max(time, 0), last);
  redraw();
}

function step(count) {
  clock.playing = false;
  seek(Math.round(clock.time) + count);
}

function speed(value) {
  clock.speed = SPEEDS.reduce((best, one) => (Math.abs(one - value) < Math.abs(best - value) ? one : best));
  redraw();
}

// To the nearest beginning of a subtask, in any episode shown, on that side.
function subtask(direction) {
  const starts = [0, last];
  for (const { episode } of panes) {
    episode.subtask.forEach((k, t) => { if (t && k !== episode.subtask[t - 1]) starts.push(t); });
  }
  const there = starts.filter((t) => direction * (t - clock.time) > 0.5);
  if (there.length) seek(there.reduce((a, b) => (Math.abs(a - clock.time) < Math.abs(b - clock.time) ? a : b)));
}

const faster = (by) => speed(SPEEDS[Math.min(Math.max(SPEEDS.indexOf(clock.speed) + by, 0), SPEEDS.length - 1)]);
const KEYS = {
  " ": () => play(!clock.playing),
  ArrowLeft: (event) => step(event.shiftKey ? -10 : -1),
  ArrowRight: (event) => step(event.shiftKey ? 10 : 1),
  "[": () => faster(-1),
  "]": () => faster(1),
  Home: () => seek(0),
  End: () => seek(last),
  n: () => subtask(1),
  p: () => subtask(-1),
  r: () => camera.reset(),
};

const panes = [];
const camera = new Camera(redraw);
episodes.slice(0, 2).forEach((_, index) => panes.push(new Pane(index)));
document.title = find("title").textContent = content.title;
find("scrub").max = last;
SPEEDS.forEach((value) => made("option", find("speed"), { value, textContent: `${value} x` }));
find("play").addEventListener("click", () => { play(!clock.playing); find("play").blur(); });
find("scrub").addEventListener("input", () => seek(+find("scrub").value));
chooses(find("speed"), speed);
window.addEventListener("resize", redraw);
window.addEventListener("keydown", (event) => {
  const action = KEYS[event.key];
  if (!action || event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === "SELECT") return;
  event.preventDefault();
  action(event);
});

// For tests and for the console: `player.seek(40)`, `player.state().panes[0].bodies`.
window.player = {
  play, seek, step, speed, last,
  pause: () => play(false),
  state: () => ({
    time: clock.time, playing: clock.playing, speed: clock.speed, last,
    camera: { azimuth: camera.azimuth, elevation: camera.elevation, distance: camera.distance },
    panes: panes.map((pane) => ({ ...pane.episode.state(clock.time), drawn: Boolean(pane.view) })),
  }),
};
redraw();
