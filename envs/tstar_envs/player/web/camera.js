// A camera that turns about a point; all views share one.

const FIRST_VIEW = { azimuth: -122, elevation: 20, distance: 1.85, target: [-0.08, 0.2, 0.29] }; // degrees, m

class Camera {
  constructor(changed) {
    this.changed = changed;
    this.reset();
  }

  reset() {
    Object.assign(this, { ...FIRST_VIEW, target: [...FIRST_VIEW.target] });
    this.changed();
  }

  eye() {
    const [azimuth, elevation] = [this.azimuth, this.elevation].map((degrees) => (degrees * Math.PI) / 180);
    const across = this.distance * Math.cos(elevation);
    return [
      this.target[0] + across * Math.cos(azimuth),
      this.target[1] + across * Math.sin(azimuth),
      this.target[2] + this.distance * Math.sin(elevation),
    ];
  }

  matrix(aspect) {
    const degrees = aspect > 1.2 ? 45 : Math.min(80, 54 / Math.max(aspect, 0.2)); // a narrow pane shows as much
    return multiply(perspective(degrees, aspect, 0.02, 60), lookAt(this.eye(), this.target));
  }

  turn(x, y) {
    this.azimuth -= 0.35 * x;
    this.elevation = Math.min(89, Math.max(-5, this.elevation + 0.35 * y));
    this.changed();
  }

  // Moves what is looked at, in the plane of the picture.
  move(x, y) {
    const back = unit(subtract(this.eye(), this.target));
    const right = unit(cross([0, 0, 1], back));
    const up = cross(back, right);
    const metres = 0.0015 * this.distance;
    for (let k = 0; k < 3; k++) this.target[k] += metres * (y * up[k] - x * right[k]);
    this.changed();
  }

  zoom(amount) {
    this.distance = Math.min(12, Math.max(0.25, this.distance * Math.exp(0.001 * amount)));
    this.changed();
  }

  // Takes the mouse (or a finger) of an element.
  follow(element) {
    element.addEventListener("pointerdown", (event) => element.setPointerCapture(event.pointerId));
    element.addEventListener("pointermove", (event) => {
      if (!event.buttons) return;
      const moves = event.shiftKey || event.buttons !== 1;
      this[moves ? "move" : "turn"](event.movementX, event.movementY);
    });
    element.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(event.deltaY);
    }, { passive: false });
    element.addEventListener("contextmenu", (event) => event.preventDefault());
    element.addEventListener("dblclick", () => this.reset());
  }
}
