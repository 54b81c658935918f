// Draws the scene on one canvas: a pass from the light for shadows, then a pass from the camera.

const LIGHT = { from: [-0.9, -1.3, 2.6], at: [-0.05, 0.25, 0.3], half: 1.5 }; // world, m
const SHADOW_SIZE = 2048;

const VERTEX = `#version 300 es
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
uniform mat4 model, seen, lit;
out vec3 place, facing;
out vec4 inLight;
void main() {
  vec4 world = model * vec4(position, 1.0);
  place = world.xyz;
  facing = mat3(model) * normal;
  inLight = lit * vec4(place + 0.004 * facing, 1.0);
  gl_Position = seen * world;
}`;

const FRAGMENT = `#version 300 es
precision highp float;
precision highp sampler2DShadow;
in vec3 place, facing;
in vec4 inLight;
uniform vec3 eye, light;
uniform vec4 colour;
uniform vec2 shine;
uniform bool tiles;
uniform sampler2DShadow shadows;
out vec4 result;

float shadow() {
  vec3 at = inLight.xyz / inLight.w * 0.5 + 0.5;
  if (any(lessThan(at, vec3(0.0))) || any(greaterThan(at, vec3(1.0)))) return 1.0;
  float sum = 0.0;
  for (int x = -1; x <= 1; x++)
    for (int y = -1; y <= 1; y++)
      sum += texture(shadows, vec3(at.xy + vec2(x, y) / ${SHADOW_SIZE}.0, at.z - 0.0006));
  return sum / 9.0;
}

void main() {
  vec3 n = normalize(facing), toEye = normalize(eye - place);
  vec3 base = colour.rgb;
  float seen = colour.a;
  if (tiles) { // lines every half metre; the floor fades into the distance
    vec2 cell = abs(fract(place.xy * 2.0 + 0.5) - 0.5) / (fwidth(place.xy) * 2.0);
    base *= mix(0.84, 1.0, clamp(min(cell.x, cell.y), 0.0, 1.0));
    seen *= 1.0 - smoothstep(2.0, 6.0, length(place.xy));
  }
  float bright = shadow();
  float direct = max(dot(n, light), 0.0) * bright;
  float high = pow(max(dot(n, normalize(light + toEye)), 0.0), 4.0 + 60.0 * shine.y);
  vec3 sky = mix(vec3(0.30, 0.29, 0.28), vec3(0.46, 0.48, 0.5), 0.5 + 0.5 * n.z);
  float rim = 0.12 * max(dot(n, toEye), 0.0);
  vec3 shown = base * (sky + rim + 0.62 * direct) + vec3(0.5 * shine.x * high * bright);
  result = vec4(shown * seen, seen);
}`;

const DEPTH_FRAGMENT = `#version 300 es
void main() {}`;

class View {
  // Throws where the browser has no WebGL 2.
  constructor(canvas, scene) {
    this.canvas = canvas;
    const gl = (this.gl = canvas.getContext("webgl2", { antialias: true, alpha: true }));
    if (!gl) throw new Error("This browser shows no WebGL 2: the episode can be read in the timeline alone.");
    this.program = linked(gl, VERTEX, FRAGMENT);
    this.depthProgram = linked(gl, VERTEX, DEPTH_FRAGMENT);
    this.geoms = scene.geoms.map((geom) => ({ ...geom, ...uploaded(gl, triangles(geom)), local: fromPose([...geom.pos, ...geom.quat]) }));
    this.geoms.sort((one, other) => (other.shape === "plane") - (one.shape === "plane") || other.rgba[3] - one.rgba[3]);
    this.lit = multiply(orthographic(LIGHT.half, 0.5, 6), lookAt(LIGHT.from, LIGHT.at));
    this.shadows = shadowMap(gl);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.CULL_FACE);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  }

  // poses: 7 numbers for each body that moves.
  draw(poses, camera) {
    const { gl, canvas } = this;
    const scale = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((n) => Math.max(1, Math.round(n * scale)));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const models = this.geoms.map((geom) => (geom.body < 0 ? geom.local : multiply(fromPose(poses, 7 * geom.body), geom.local)));

    gl.bindFramebuffer(gl.FRAMEBUFFER, this.shadows.frame);
    gl.viewport(0, 0, SHADOW_SIZE, SHADOW_SIZE);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.disable(gl.BLEND);
    this.each(this.depthProgram, models, this.lit, (geom) => geom.shape !== "plane");

    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.BLEND);
    gl.useProgram(this.program.id);
    gl.uniformMatrix4fv(this.program.at("lit"), false, this.lit);
    gl.uniform3fv(this.program.at("eye"), camera.eye());
    gl.uniform3fv(this.program.at("light"), unit(subtract(LIGHT.from, LIGHT.at)));
    this.each(this.program, models, camera.matrix(width / height), () => true);
  }

  each(program, models, seen, wanted) {
    const { gl } = this;
    gl.useProgram(program.id);
    gl.uniformMatrix4fv(program.at("seen"), false, seen);
    this.geoms.forEach((geom, i) => {
      if (!wanted(geom)) return;
      gl.uniformMatrix4fv(program.at("model"), false, models[i]);
      gl.uniform4fv(program.at("colour"), geom.shape === "plane" ? [0.8, 0.82, 0.84, 1] : geom.rgba);
      gl.uniform2f(program.at("shine"), geom.specular, geom.shininess);
      gl.uniform1i(program.at("tiles"), geom.shape === "plane");
      gl.bindVertexArray(geom.array);
      gl.drawArrays(gl.TRIANGLES, 0, geom.corners);
    });
  }
}

function linked(gl, vertex, fragment) {
  const id = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(id, shader);
  }
  gl.linkProgram(id);
  if (!gl.getProgramParameter(id, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(id));
  const known = {};
  const at = (name) => (known[name] ??= gl.getUniformLocation(id, name));
  return { id, at };
}

function uploaded(gl, mesh) {
  const array = gl.createVertexArray();
  gl.bindVertexArray(array);
  [mesh.positions, mesh.normals].forEach((values, place) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(values), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
  });
  return { array, corners: mesh.positions.length / 3 };
}

function shadowMap(gl) {
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl.DEPTH_COMPONENT24, SHADOW_SIZE, SHADOW_SIZE);
  for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, filter, gl.LINEAR);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE);
  const frame = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, gl.getParameter(gl.TEXTURE_BINDING_2D), 0);
  return { frame };
}
