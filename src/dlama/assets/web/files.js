// Files that were dropped in; which of them is the picture, its depth, its camera, or the other one of a pair, out.
const ending = (name) => (name.match(/\.[^.]+$/)?.[0] ?? "").toLowerCase();
const NUMBERS_ONLY = [".exr", ".pfm", ".npy", ".npz", ".pcd"];
const TEXTS = [".txt", ".json", ".yaml", ".yml", ".xml"];
// Of several texts, those that are called so.
const isNamed = (file) => TEXTS.includes(ending(file.name)) && /calib|camera|stereo/i.test(file.name);

// `left` has the files that are not taken, each with why.
export function rolesOf(list, have, endings) {
  const found = {}, left = [], masks = [];
  const pictures = [];
  const take = (role, file) => {
    if (found[role]) left.push([file, `is left out, for ${found[role].name} is taken`]);
    else found[role] = file;
  };
  for (const file of [...list].sort((one, other) => isNamed(other) - isNamed(one))) {
    const kind = ending(file.name), name = file.name.toLowerCase();
    if (NUMBERS_ONLY.includes(kind)) take("depth", file);
    else if (kind === ".txt") take("calib", file);
    else if (TEXTS.includes(kind)) take(/calib|stereo|right/.test(name) ? "calib" : "camera", file);
    else if (endings.picture.includes(kind)) pictures.push(file);
    else left.push([file, `is no file that this page takes (${[...new Set(Object.values(endings).flat())].join(", ")})`]);
  }
  for (const file of pictures) {
    const name = file.name.toLowerCase();
    if (/(^|[^a-z])mask/.test(name) && list.length > 1) masks.push(file);
    else if (!found.depth && endings.depth.includes(ending(name)) && /depth|tiefe|disp(arity|[^a-z])/.test(name)) found.depth = file;
    else if (!found.right && /(^|[^a-z])(right|rechts|im1|image1|view5)([^a-z]|$)/.test(name)) found.right = file;
    else if (!found.picture && !(have.picture && pictures.length === 1 && (found.calib || have.calib) && !have.right)) found.picture = file;
    else take("right", file);
  }
  if (found.calib && !found.right && !have.right && ending(found.calib.name) !== ".json") {
    take("camera", found.calib);
    delete found.calib;
  }
  return { found, left, masks };
}
