/** Requests to the server, and its errors. */

/** The three parts of an error as a text: what arrived, what was expected, what to do. */
export const faultText = ({ found, expected, remedy }) => `${found} (expected: ${expected}; what to do: ${remedy})`;

/** An error that the server found, in three parts. */
export class Fault extends Error {
  constructor(fault) { super(faultText(fault)); }
}

/** The server does not answer, or not this page. */
class Gone extends Error {}

async function request(address, options = {}) {
  let answer;
  try {
    answer = await fetch(address, { ...options, credentials: "same-origin", cache: "no-store", redirect: "error" });
  } catch {
    throw new Gone("Studio does not answer and probably no longer runs. The contents of this page stay visible. " +
      "To continue, start studio again with the same --port and open the address that studio prints.");
  }
  if (answer.ok) return answer;
  const isFault = (answer.headers.get("content-type") || "").startsWith("application/json");
  if (isFault) throw new Fault((await answer.json()).error);
  if (answer.status === 403) {
    throw new Gone("This page belongs to a studio process that has ended. To continue, open the address that studio printed at its last start.");
  }
  throw new Gone(`Studio answered with the HTTP error ${answer.status}. Read studio's messages in the terminal where you started studio.`);
}

/** The JSON at an address. */
export const getJson = async (name, query = {}) => (await get(name, query)).json();

/** The bytes at an address, as a blob. */
export const getBlob = async (name, query) => (await get(name, query)).blob();

/** JSON and bytes in one answer: {about, content}. */
async function getFramed(name, query = {}) {
  const bytes = await (await get(name, query)).arrayBuffer();
  const length = new DataView(bytes).getUint32(0, true);
  const about = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, length)));
  return { about, content: new Uint8Array(bytes, 4 + length) };
}

/** Small pictures, as `Tiles` expects them. */
async function getTiles(name, query) {
  const { about, content } = await getFramed(name, query);
  return { ...about, image: new Blob([content], { type: about.kind }) };
}

/** Send JSON; the JSON that answers it. */
export const postJson = async (name, body) => (await post(name, body)).json();

/** Send JSON; the float32 numbers that answer it. */
const postNumbers = async (name, body) => new Float32Array(await (await post(name, body)).arrayBuffer());

/** Send JSON; the browser saves the answer under the answer's own name, or else as `file`. Returns the name. */
export async function downloadFile(name, body, file) {
  const answer = await post(name, body), link = document.createElement("a");
  link.href = URL.createObjectURL(await answer.blob());
  link.download = /filename="([^"]+)"/.exec(answer.headers.get("content-disposition"))?.[1] || file;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
  return link.download;
}

const get = (name, query) => request(`/api/${name}?${new URLSearchParams(query)}`);

const post = (name, body) => request(`/api/${name}`, {
  method: "POST", headers: { "content-type": "application/json", "x-evocity": "studio" }, body: JSON.stringify(body),
});

/** Send a file under its name, with `more` arguments; the JSON that answers it. */
export const uploadFile = async (name, file, more = {}) => (await request(`/api/${name}?${new URLSearchParams({ name: file.name, ...more })}`, {
  method: "POST", headers: { "content-type": "application/octet-stream", "x-evocity": "studio" }, body: file,
})).json();

/** All these functions for one run, by its number. */
export const serverOfRun = (run) => Object.fromEntries(Object.entries({ getJson, getBlob, getFramed, getTiles, postJson, postNumbers, downloadFile })
  .map(([name, ask]) => [name, (address, ...rest) => ask(`${run}/${address}`, ...rest)]));
