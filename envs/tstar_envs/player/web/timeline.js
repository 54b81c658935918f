// Subtasks, phases, rewards and further series of one episode over its steps; a click goes to a step.

const SUBTASK_COLOURS = ["#4f8fc4", "#d98a2b", "#4ea36f", "#b5679b", "#8f7fd0", "#b89a2e", "#3aa6a6", "#c7635a"];
const LABELS = 62; // px, left of the rows
const ROW = { subtask: 18, phase: 34, reward: 44, series: 34, gap: 5 };

// Of numbers and these two. A long episode has more numbers than a call may have arguments.
function range(values, least, most) {
  for (const value of values) {
    if (value === null) continue;
    least = Math.min(least, value);
    most = Math.max(most, value);
  }
  return [least, most];
}

class Timeline {
  constructor(canvas, steps, seek) {
    this.canvas = canvas;
    this.steps = steps; // of the longest episode, so that those side by side have one scale
    const go = (event) => {
      if (event.buttons) seek(Math.min(Math.max((event.offsetX - LABELS) / this.width(), 0), 1) * this.steps);
    };
    canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); go(event); });
    canvas.addEventListener("pointermove", go);
  }

  width() { return Math.max(1, this.canvas.clientWidth - LABELS - 8); }
  x(step) { return LABELS + (step / this.steps) * this.width(); }

  // The rows are painted once, and again when something of them is another; the cursor in every frame.
  draw(episode, time, names) {
    const rows = ["subtask", "phase", "reward", ...Object.keys(episode.series)];
    const heights = rows.map((name, i) => (i < 3 ? ROW[name] : ROW.series));
    const height = heights.reduce((sum, h) => sum + h + ROW.gap, ROW.gap);
    const scale = window.devicePixelRatio || 1;
    const style = getComputedStyle(document.documentElement);
    this.colour = (name) => style.getPropertyValue(`--${name}`);
    this.canvas.style.height = `${height}px`;
    const size = [Math.round(this.canvas.clientWidth * scale), Math.round(height * scale)];
    const shown = [episode, scale, this.colour("ink"), ...size];
    if (!this.shown || shown.some((each, i) => each !== this.shown[i])) {
      [this.shown, this.still] = [shown, document.createElement("canvas")];
      [this.still.width, this.still.height] = size;
      this.pen = this.still.getContext("2d");
      this.pen.scale(scale, scale);
      this.rows(episode, rows, heights, height, names);
    }
    [this.canvas.width, this.canvas.height] = size;
    const pen = this.canvas.getContext("2d");
    if (size[0] && size[1]) pen.drawImage(this.still, 0, 0);
    pen.scale(scale, scale);
    pen.fillStyle = this.colour("ink");
    pen.fillRect(this.x(time) - 0.75, 0, 1.5, height);
  }

  rows(episode, rows, heights, height, names) {
    const pen = this.pen;
    pen.font = "11px system-ui, sans-serif";
    pen.textBaseline = "middle";
    let top = ROW.gap;
    rows.forEach((name, i) => {
      pen.fillStyle = this.colour("faint");
      pen.fillText(name, 8, top + heights[i] / 2, LABELS - 12);
      if (name === "subtask") this.subtasks(episode, top, heights[i]);
      else if (name === "phase") this.phases(episode, top, heights[i], names.phases);
      else if (name === "reward") this.rewards(episode, top, heights[i]);
      else this.points(episode.series[name], top, heights[i]);
      top += heights[i] + ROW.gap;
    });
    pen.fillStyle = this.colour(episode.success ? "good" : "bad");
    pen.fillRect(this.x(episode.steps) - 1, ROW.gap, 3, height - 2 * ROW.gap);
  }

  // One bar for each stretch of steps that were taken in the same subtask.
  subtasks(episode, top, height) {
    for (let from = 0, step = 1; step <= episode.steps; step++) {
      if (step < episode.steps && episode.subtask[step] === episode.subtask[from]) continue;
      const [left, right] = [this.x(from), this.x(step)];
      this.pen.fillStyle = SUBTASK_COLOURS[episode.subtask[from] % SUBTASK_COLOURS.length];
      this.pen.fillRect(left, top, right - left - 1, height);
      this.pen.fillStyle = "#ffffff";
      if (right - left > 14) this.pen.fillText(`${episode.subtask[from] + 1}`, left + 5, top + height / 2);
      from = step;
    }
  }

  phases(episode, top, height, names) {
    const count = Math.max(names.length, range(episode.phase, 0, 0)[1] + 1);
    for (let step = 0; step < episode.steps; step++) {
      const high = (height * (episode.phase[step] + 1)) / count;
      this.pen.fillStyle = SUBTASK_COLOURS[episode.subtask[step] % SUBTASK_COLOURS.length];
      this.pen.fillRect(this.x(step), top + height - high, this.x(step + 1) - this.x(step) + 0.3, high);
    }
    this.line(top + height);
  }

  // Bonuses are a thousand times the rest, so heights are logarithmic away from zero.
  rewards(episode, top, height) {
    const tall = (value) => Math.sign(value) * Math.log10(1 + Math.abs(value));
    const [least, most] = range(episode.reward.map(tall), 0, 1);
    const y = (value) => top + (height * (most - value)) / (most - least);
    this.pen.fillStyle = this.colour("reward");
    episode.reward.forEach((value, step) => {
      const wide = Math.max(1, this.x(step + 1) - this.x(step));
      this.pen.fillRect(this.x(step), Math.min(y(0), y(tall(value))), wide, Math.abs(y(tall(value)) - y(0)));
    });
    this.line(y(0));
  }

  points(values, top, height) {
    const [least, most] = range(values, 0, 1);
    const y = (value) => top + 4 + ((height - 8) * (most - value)) / (most - least);
    this.line(y(0));
    this.line(y(1));
    this.pen.fillStyle = this.colour("point");
    values.forEach((value, step) => {
      if (value === null) return;
      this.pen.beginPath();
      this.pen.arc(this.x(step + 1), y(value), 3.5, 0, 2 * Math.PI);
      this.pen.fill();
    });
  }

  line(y) {
    this.pen.fillStyle = this.colour("line");
    this.pen.fillRect(LABELS, y, this.width(), 1);
  }
}
