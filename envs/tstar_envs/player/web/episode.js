// A recorded episode: state t is before step t + 1; there is one more state than steps.

class Recording {
  constructor(plain, bodies) {
    Object.assign(this, plain, { bodies });
    const bytes = Uint8Array.from(atob(plain.poses), (character) => character.charCodeAt(0));
    this.poses = new Float32Array(bytes.buffer);
    this.now = new Float32Array(7 * bodies.length);
  }

  // Poses at a time between two states. The arm jumps home where a subtask ends: nothing is drawn in between.
  at(time) {
    const size = this.now.length;
    const first = Math.min(Math.floor(time), this.steps);
    const second = Math.min(first + 1, this.steps);
    const jumps = this.subtask[first] !== this.subtask[second];
    const share = jumps ? 0 : time - first;
    for (let body = 0; body < size; body += 7) {
      const [a, b] = [first * size + body, second * size + body];
      let along = 0;
      for (let k = 3; k < 7; k++) along += this.poses[a + k] * this.poses[b + k];
      for (let k = 0; k < 7; k++) {
        const sign = k > 2 && along < 0 ? -1 : 1; // a quaternion and its negative are one rotation
        this.now[body + k] = (1 - share) * this.poses[a + k] + share * sign * this.poses[b + k];
      }
    }
    return this.now;
  }

  // The last value of a series up to a state, or null.
  latest(name, state) {
    for (let step = Math.min(state, this.steps) - 1; step >= 0; step--) {
      if (this.series[name][step] !== null) return this.series[name][step];
    }
    return null;
  }

  // What there is to say of a state, as plain values.
  state(time) {
    const state = Math.min(Math.round(time), this.steps);
    const size = this.now.length;
    const pose = (i) => Array.from(this.poses.slice(state * size + 7 * i, state * size + 7 * i + 7));
    return {
      title: this.title, step: state, steps: this.steps, success: this.success,
      subtask: this.subtask[state], phase: this.phase[state], reward: state ? this.reward[state - 1] : null,
      series: Object.fromEntries(Object.keys(this.series).map((name) => [name, this.latest(name, state)])),
      bodies: Object.fromEntries(this.bodies.map((name, i) => [name, pose(i)])),
    };
  }
}
