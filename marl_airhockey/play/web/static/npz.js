// Reader of .npz files: a ZIP archive of NumPy arrays.

const MOST = 100; // arrays
const LARGEST = 64e6; // bytes
const TYPES = { f4: Float32Array, f8: Float64Array };

export async function inflated(bytes, format) {
  return new Uint8Array(await new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream(format))).arrayBuffer());
}

// Arrays by name: { shape, data }; data is a text for an array of characters.
export async function readNpz(buffer) {
  const view = new DataView(buffer), bytes = new Uint8Array(buffer), found = {};
  let end = buffer.byteLength - 22;
  while (end >= 0 && view.getUint32(end, true) !== 0x06054b50) end--;
  if (end < 0) throw new Error("it is not an .npz file");
  const count = view.getUint16(end + 10, true);
  let at = view.getUint32(end + 16, true), total = 0;
  if (count > MOST) throw new Error(`${count} arrays are too many`);
  for (let k = 0; k < count; k++) {
    const [method, packed, size] = [view.getUint16(at + 10, true), view.getUint32(at + 20, true), view.getUint32(at + 24, true)];
    const [name, extra, comment] = [28, 30, 32].map((offset) => view.getUint16(at + offset, true)), local = view.getUint32(at + 42, true);
    const title = new TextDecoder().decode(bytes.subarray(at + 46, at + 46 + name)).replace(/\.npy$/, "");
    const begin = local + 30 + view.getUint16(local + 26, true) + view.getUint16(local + 28, true), data = bytes.subarray(begin, begin + packed);
    total += size;
    if (total > LARGEST) throw new Error("it is too large");
    found[title] = arrayOf(method === 8 ? await inflated(data, "deflate-raw") : data.slice(), title);
    at += 46 + name + extra + comment;
  }
  return found;
}

function arrayOf(bytes, title) {
  const length = bytes[8] + 256 * bytes[9], header = new TextDecoder("latin1").decode(bytes.subarray(10, 10 + length));
  if (bytes[0] !== 0x93 || bytes[6] !== 1) throw new Error(`${title}: unknown version of the format`);
  const [, type] = header.match(/'descr': '<([fU]\d+)'/) || [], fortran = /'fortran_order': True/.test(header);
  const shape = (header.match(/'shape': \(([^)]*)\)/) || ["", ""])[1].split(",").filter((text) => text.trim()).map(Number);
  const rest = bytes.slice(10 + length).buffer;
  if (type && type[0] === "U") return { shape, data: String.fromCodePoint(...new Uint32Array(rest)).replace(/\0+$/, "") };
  if (!(type in TYPES)) throw new Error(`${title}: numbers of type ${type} are not possible`);
  const data = new TYPES[type](rest);
  if (data.length !== shape.reduce((a, b) => a * b, 1)) throw new Error(`${title}: ${data.length} numbers in the shape ${shape}`);
  return { shape, data: fortran && shape.length === 2 ? transposed(data, shape) : data };
}

function transposed(data, [rows, columns]) {
  return data.map((_, k) => data[(k % columns) * rows + Math.floor(k / columns)]);
}
