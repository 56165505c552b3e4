// Files that were dropped in; which of them is the picture, its depth, its camera, or the other one of a pair, out.
const ending = (name) => (name.match(/\.[^.]+$/)?.[0] ?? "").toLowerCase();
const NUMBERS_ONLY = [".exr", ".pfm", ".npy", ".npz"];

export function rolesOf(list, have, endings) {
  const found = {}, left = [], masks = [];
  const pictures = [];
  for (const file of list) {
    const kind = ending(file.name), name = file.name.toLowerCase();
    if (NUMBERS_ONLY.includes(kind)) found.depth = file;
    else if (kind === ".txt") found.calib = file;
    else if ([".yaml", ".yml"].includes(kind)) found.camera = file;
    else if (kind === ".json") found[/calib|stereo/.test(name) ? "calib" : "camera"] = file;
    else if (endings.picture.includes(kind)) pictures.push(file);
    else left.push(file);
  }
  for (const file of pictures) {
    const name = file.name.toLowerCase();
    if (/(^|[^a-z])mask/.test(name) && list.length > 1) masks.push(file);
    else if (!found.depth && endings.depth.includes(ending(name)) && /depth|tiefe|disp(arity|[^a-z])/.test(name)) found.depth = file;
    else if (!found.right && /(^|[^a-z])(right|rechts|im1|image1|view5)([^a-z]|$)/.test(name)) found.right = file;
    else if (!found.picture && !(have.picture && pictures.length === 1 && (found.calib || have.calib) && !have.right)) found.picture = file;
    else if (!found.right) found.right = file;
    else left.push(file);
  }
  if (found.calib && !found.right && !have.right && ending(found.calib.name) === ".txt") {
    found.camera = found.calib;
    delete found.calib;
  }
  return { found, left, masks };
}
