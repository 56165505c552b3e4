// Two pictures of one size in; one over the other with a border to drag, and the pixel that is clicked, out.
export class Compare {
  constructor(root, slider, clicked) {
    this.root = root;
    this.slider = slider;
    this.after = root.querySelector("#after");
    this.handle = root.querySelector("#handle");
    slider.addEventListener("input", () => this.split(Number(slider.value)));
    this.handle.addEventListener("pointerdown", (event) => { this.handle.setPointerCapture(event.pointerId); this.dragging = true; event.preventDefault(); });
    this.handle.addEventListener("pointermove", (event) => { if (this.dragging) this.split(100 * this.across(event)[0]); });
    this.handle.addEventListener("pointerup", () => { this.dragging = false; });
    this.handle.addEventListener("click", (event) => event.stopPropagation());
    root.addEventListener("click", (event) => clicked(...this.across(event)));
    this.split(50);
  }

  across(event) {
    const box = this.root.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height].map((v) => Math.min(Math.max(v, 0), 0.99999));
  }

  split(share) {
    const value = Math.min(Math.max(share, 0), 100);
    this.slider.value = value;
    this.after.style.clipPath = `inset(0 0 0 ${value}%)`;
    this.handle.style.left = `${value}%`;
  }
}
