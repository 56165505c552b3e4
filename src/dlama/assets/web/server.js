// Requests to the server in; its answers out. A visit is one open page: its number is kept for a reload, and for nothing else. It
// is stored while the page is away: a copy of an open tab would find it, and forget this page's pictures when it is closed.
const KEY = "dlama-visit", FORM = "dlama-form";
const PATIENCE = 20;
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
  if (answer.status === 410) { visit = ""; onGone(failure.error); }
  throw new Failure(failure.error, failure.field, answer.status);
}

// Begin, or resume, a visit: the server's settings, what it still knows of us, and the form as it was left (null: nothing).
export async function begin(gone) {
  onGone = () => {};
  visit = sessionStorage.getItem(KEY) ?? "";
  const form = JSON.parse(sessionStorage.getItem(FORM) ?? "null");
  stay();
  const settings = await (await post("/api/settings", "{}")).json();
  let state = visit ? await ask("state").catch(() => null) : null;
  if (!state) {
    visit = (await (await post("/api/visit", "{}")).json()).visit;
  }
  onGone = gone;
  return { settings, state, form: state && form };
}

export const ask = async (action, fields = {}) => (await post(`/api/${action}`, JSON.stringify(fields))).json();

// A picture or a file: { blob, headers }.
export async function fetched(action, fields = {}) {
  const answer = await post(`/api/${action}`, JSON.stringify(fields));
  return { blob: await answer.blob(), headers: answer.headers };
}

// Follow what is under way until it ends: `show` gets each answer; the last one is returned. A connection may break for a while.
export async function follow(show) {
  for (let broken = 0; ;) {
    let answer;
    try {
      answer = await ask("run");
      broken = 0;
    } catch (error) {
      if (error.status !== 0 || ++broken > PATIENCE) throw error;
      await new Promise((done) => setTimeout(done, 1000));
      continue;
    }
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

function stay() { for (const key of [KEY, FORM]) sessionStorage.removeItem(key); }

export function leave(form) {
  if (!visit) return;
  sessionStorage.setItem(KEY, visit);
  sessionStorage.setItem(FORM, JSON.stringify(form));
  navigator.sendBeacon("/api/leave", visit);
}

// The page was shown again as the browser had kept it.
export function comeBack() {
  stay();
  if (visit) ask("alive").catch(() => {});
}

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
