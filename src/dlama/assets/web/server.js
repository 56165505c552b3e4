// Requests to the server in; its answers out. A visit is one open page: its number is kept for a reload, and for nothing else.
const KEY = "dlama-visit";
let visit = "";
let onGone = () => {};

export class Failure extends Error {
  constructor(message, field, status) { super(message); this.field = field; this.status = status; }
}

async function post(path, body, headers = {}) {
  let answer;
  try {
    answer = await fetch(path, { method: "POST", body, headers: { "X-Dlama-Visit": visit, ...headers } });
  } catch (error) {
    throw new Failure("the server does not answer; is dlama serve still running?", "", 0);
  }
  if (answer.ok) return answer;
  const failure = await answer.json().catch(() => ({ error: `the server answered ${answer.status}`, field: "" }));
  if (answer.status === 410) { sessionStorage.removeItem(KEY); onGone(failure.error); }
  throw new Failure(failure.error, failure.field, answer.status);
}

// Begin, or resume, a visit: the server's settings, and what it still knows of us (null: nothing).
export async function begin(gone) {
  onGone = () => {};
  visit = sessionStorage.getItem(KEY) ?? "";
  const settings = await (await post("/api/settings", "{}")).json();
  let state = visit ? await ask("state").catch(() => null) : null;
  if (!state) {
    visit = (await (await post("/api/visit", "{}")).json()).visit;
    sessionStorage.setItem(KEY, visit);
  }
  onGone = gone;
  return { settings, state };
}

export const ask = async (action, fields = {}) => (await post(`/api/${action}`, JSON.stringify(fields))).json();

// A picture or a file: { blob, headers }.
export async function fetched(action, fields = {}) {
  const answer = await post(`/api/${action}`, JSON.stringify(fields));
  return { blob: await answer.blob(), headers: answer.headers };
}

// Follow what is under way until it ends: `show` gets each answer; the last one is returned.
export async function follow(show) {
  for (;;) {
    const answer = await ask("run");
    show(answer);
    if (!["waiting", "running"].includes(answer.state)) return answer;
    await new Promise((done) => setTimeout(done, 200));
  }
}

// What changes the visit goes one after the other, in the order it was asked for, however long an answer takes.
let last = Promise.resolve();
export function inTurn(work) {
  const done = last.then(work);
  last = done.catch(() => {});
  return done;
}

export const bitmap = async (action, fields) => createImageBitmap((await fetched(action, fields)).blob);

export const upload = async (role, file) =>
  (await post(`/api/upload?role=${role}`, file, { "X-Name": encodeURIComponent(file.name) })).json();

export function leave() { if (visit) navigator.sendBeacon("/api/leave", visit); }

// Put a blob into an <img>, and let go of what it showed before.
export function showIn(image, blob) {
  const old = image.src;
  image.src = URL.createObjectURL(blob);
  if (old.startsWith("blob:")) URL.revokeObjectURL(old);
  return image.decode().catch(() => {});
}

export function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
