// A geom as triangles: positions and normals, three numbers a corner, in the geom's own frame.
// Sizes are MuJoCo's: radius and half-length of a capsule or cylinder (along z), half-axes of a box or ellipsoid.

const AROUND = 32;
const ARC = 10;
const FLOOR_REACH = 30; // m; MuJoCo's floor has no end

function triangles(geom) {
  const [a, b, c] = geom.size;
  switch (geom.shape) {
    case "plane": return box(a || FLOOR_REACH, b || FLOOR_REACH, 0);
    case "box": return box(a, b, c);
    case "sphere": return turned(arc(a, 0, -90, 90));
    case "ellipsoid": return stretched(turned(arc(1, 0, -90, 90)), [a, b, c]);
    case "capsule": return turned([...arc(a, -b, -90, 0), ...arc(a, b, 0, 90)]);
    case "cylinder": return turned([[0, -b, 0, -1], [a, -b, 0, -1], [a, -b, 1, 0], [a, b, 1, 0], [a, b, 0, 1], [0, b, 0, 1]]);
  }
  throw new Error(`no such shape: ${geom.shape}`);
}

// Points of a profile: distance from the axis, height, and the normal's two parts.
function arc(radius, height, from, to) {
  return Array.from({ length: ARC + 1 }, (_, i) => {
    const angle = ((from + ((to - from) * i) / ARC) * Math.PI) / 180;
    const [across, up] = [Math.cos(angle), Math.sin(angle)];
    return [radius * across, height + radius * up, across, up];
  });
}

function turned(profile) {
  const mesh = { positions: [], normals: [] };
  const corner = ([r, z, nr, nz], step) => {
    const angle = (2 * Math.PI * step) / AROUND;
    mesh.positions.push(r * Math.cos(angle), r * Math.sin(angle), z);
    mesh.normals.push(nr * Math.cos(angle), nr * Math.sin(angle), nz);
  };
  for (let i = 0; i + 1 < profile.length; i++) {
    const [low, high] = [profile[i], profile[i + 1]];
    for (let step = 0; step < AROUND; step++) {
      corner(low, step); corner(low, step + 1); corner(high, step + 1);
      corner(low, step); corner(high, step + 1); corner(high, step);
    }
  }
  return mesh;
}

function stretched(mesh, axes) {
  for (let i = 0; i < mesh.positions.length; i += 3) {
    const normal = unit([0, 1, 2].map((k) => mesh.normals[i + k] / axes[k]));
    for (let k = 0; k < 3; k++) {
      mesh.positions[i + k] *= axes[k];
      mesh.normals[i + k] = normal[k];
    }
  }
  return mesh;
}

function box(...half) {
  const mesh = { positions: [], normals: [] };
  for (let axis = 0; axis < 3; axis++) {
    for (const side of [-1, 1]) {
      const [u, v] = side > 0 ? [(axis + 1) % 3, (axis + 2) % 3] : [(axis + 2) % 3, (axis + 1) % 3];
      for (const [s, t] of [[-1, -1], [1, -1], [1, 1], [-1, -1], [1, 1], [-1, 1]]) {
        const point = [0, 0, 0], normal = [0, 0, 0];
        point[axis] = side * half[axis]; point[u] = s * half[u]; point[v] = t * half[v];
        normal[axis] = side;
        mesh.positions.push(...point);
        mesh.normals.push(...normal);
      }
    }
  }
  return mesh;
}
