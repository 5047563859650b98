/** What the server is asked and told, and how it says no. */

/** It said no, in three parts: what was found, what was expected, what to do. */
export class Fault extends Error {
  constructor({ found, expected, remedy }) {
    super(`${found} (expected: ${expected}; what to do: ${remedy})`);
  }
}

/** It does not answer, or not to this page. */
export class Gone extends Error {}

async function answered(address, options = {}) {
  let answer;
  try {
    answer = await fetch(address, { ...options, credentials: "same-origin", cache: "no-store", redirect: "error" });
  } catch {
    throw new Gone("Studio does not answer: it has ended. What is seen here stays. Start it again with the same " +
      "--port and this page goes on, once you have opened the address that it prints.");
  }
  if (answer.ok) return answer;
  const isTold = (answer.headers.get("content-type") || "").startsWith("application/json");
  if (isTold) throw new Fault((await answer.json()).error);
  if (answer.status === 403) {
    throw new Gone("Studio was started again, and does not know this page: open the address that it printed, and " +
      "this page goes on too.");
  }
  throw new Gone(`Studio could not answer (${answer.status}). See what it printed.`);
}

/** An answer to a question; JSON. */
export const asked = async (name, query = {}) => (await question(name, query)).json();

/** An answer in bytes, as a blob. */
export const blobOf = async (name, query) => (await question(name, query)).blob();

/** An answer of what is told of bytes, and these. */
export async function framed(name, query = {}) {
  const bytes = await (await question(name, query)).arrayBuffer();
  const length = new DataView(bytes).getUint32(0, true);
  const about = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, length)));
  return { about, content: new Uint8Array(bytes, 4 + length) };
}

/** Small pictures, as `Tiles` asks for them. */
export async function tiles(name, query) {
  const { about, content } = await framed(name, query);
  return { ...about, image: new Blob([content], { type: about.kind }) };
}

/** What is to be changed; the answer, JSON. */
export const told = async (name, body) => (await change(name, body)).json();

/** The answer to what a body asks: float32. */
export const numbers = async (name, body) => new Float32Array(await (await change(name, body)).arrayBuffer());

/** What is to be saved: a file that the browser keeps under a name. */
export async function saved(name, body, file) {
  const address = URL.createObjectURL(await (await change(name, body)).blob());
  const link = document.createElement("a");
  link.href = address;
  link.download = file;
  link.click();
  setTimeout(() => URL.revokeObjectURL(address), 60000);
}

const question = (name, query) => answered(`/api/${name}?${new URLSearchParams(query)}`);

const change = (name, body) => answered(`/api/${name}`, {
  method: "POST", headers: { "content-type": "application/json", "x-evocity": "studio" }, body: JSON.stringify(body),
});

/** A file that is brought, under its name. */
export const brought = async (name, file) => (await answered(`/api/${name}?${new URLSearchParams({ name: file.name })}`, {
  method: "POST", headers: { "content-type": "application/octet-stream", "x-evocity": "studio" }, body: file,
})).json();

/** The same of one run, by its number. */
export const ofRun = (run) => Object.fromEntries(Object.entries({ asked, blobOf, framed, tiles, told, numbers, saved })
  .map(([name, ask]) => [name, (what, ...rest) => ask(`${run}/${what}`, ...rest)]));
