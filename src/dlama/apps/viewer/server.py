"""Contents in; a page in the browser, served by viser, out: points, mesh, cameras, a path, pictures saved by our own renderer."""

from __future__ import annotations

import contextlib
import io
import json
import threading
import webbrowser
from typing import Any

import numpy as np
from PIL import Image

from dlama.apps.terminal.streams import printable
from dlama.apps.viewer.cameras import camera_of, camera_on_path, go_to, overview, wxyz
from dlama.apps.viewer.contents import Contents, colors, sample_points, select_points
from dlama.errors import InputError, MissingExtraError, format_count
from dlama.files.cameras import camera_as_json
from dlama.geometry.camera import Camera
from dlama.geometry.cloud import concatenate
from dlama.geometry.fusion import scene_mesh
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import UInt8Array
from dlama.geometry.trajectories import FARTHEST_M, dolly, orbit

COLORS = {"Picture": "picture", "Origin": "origin", "Confidence": "confidence"}
FRAME_PICTURE = 256
"""Pixels, largest side of the pictures in the frusta."""
ASIDE, BEHIND = (12.0, 6.0), 0.25
"""Where a visitor begins: yaw and pitch in degrees from the first camera, and so many times the median distance behind it."""
STEPS_PER_SECOND = 30
SECONDS_PER_CAMERA = 1.5
"""Of a path that is played."""


def serve(contents: Contents, host: str, port: int, most_points: int, open_browser: bool) -> str:
    """Show the contents until Ctrl-C; the address they were at. Raises InputError, MissingExtraError."""
    if most_points < 1:
        raise InputError(f"max_points is {most_points}; a whole number >= 1 is expected")
    if not 0 < port < 65536:
        raise InputError(f"port is {port}; a number from 1 to 65535 is expected")
    viewer = Viewer(contents, host, port, most_points)
    try:
        print(printable(f"{viewer.line}\n{viewer.address} (Ctrl-C ends it)"), flush=True)
        if open_browser:
            webbrowser.open(viewer.address)
        threading.Event().wait()
    except KeyboardInterrupt:
        pass
    finally:
        viewer.stop()
    return viewer.address


class Viewer:
    """One page. Raises MissingExtraError without viser, InputError where the port is taken."""

    def __init__(self, contents: Contents, host: str, port: int, most_points: int) -> None:
        try:
            import viser
        except ImportError as error:
            raise MissingExtraError("the viewer", "viser", "view") from error
        self.contents = contents
        self.clouds = sample_points(contents.clouds, most_points)
        self.spacing = typical_spacing(contents)
        self.path: list[Camera] = []
        self.changing = threading.Lock()
        try:
            with contextlib.redirect_stdout(io.StringIO()):  # it prints a box with addresses
                self.server = viser.ViserServer(host=host, port=port, label="dlama", verbose=False)
        except OSError as error:
            raise InputError(f"port {port} of {host} cannot be opened ({error}); give another port") from error
        self.server.scene.set_up_direction("-y")
        self.server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
        self.add_controls()
        self.add_frames()
        self.draw_points()
        self.server.on_client_connect(self.greet)

    @property
    def address(self) -> str:
        """Where the page is."""
        host = self.server.get_host()
        return f"http://{'localhost' if host in ('127.0.0.1', '0.0.0.0') else host}:{self.server.get_port()}"

    @property
    def line(self) -> str:
        """What is shown, in a line."""
        whole = sum(map(len, self.contents.clouds.values()))
        drawn = sum(map(len, self.clouds.values()))
        points = f"{whole} points" if drawn == whole else f"{drawn} of {whole} points, drawn by lot"
        return "; ".join(
            [
                f"{self.contents.title}: {points}, {format_count(len(self.contents.frames), 'camera')}",
                *self.contents.notes,
            ]
        )

    def stop(self) -> None:
        """Close the page and its port."""
        self.server.stop()

    def add_controls(self) -> None:
        """The panel at the side."""
        gui: Any = self.server.gui
        gui.add_markdown(f"**{self.line}**")
        with gui.add_folder("Show"):
            self.shown = {name: gui.add_checkbox(name.capitalize(), True) for name in self.clouds}
            if "removed object" in self.shown:
                self.shown["removed object"].value = False
            self.by = gui.add_dropdown("Colours", tuple(COLORS))
            self.size = gui.add_slider("Point size", 0.2, 5.0, 0.1, 1.0, hint="Times the distance between points")
            self.least = gui.add_slider(
                "Confidence from", 0.0, 1.0, 0.01, 0.0, hint="Points below this confidence are hidden"
            )
            self.cameras = gui.add_checkbox("Cameras", True, disabled=not self.contents.frames)
            self.mesh = gui.add_checkbox("Mesh", False, disabled=self.contents.scene is None)
        with gui.add_folder("Path"):
            add, play = gui.add_button("Add this view"), gui.add_button("Play")
            keep, clear = gui.add_button("Save as CAMERAS.json"), gui.add_button("Clear")
        save = gui.add_button("Save a picture from here", hint="Rendered by dlama, not a screenshot")
        for control in (*self.shown.values(), self.by, self.size, self.least):
            control.on_update(lambda _: self.draw_points())
        self.cameras.on_update(lambda _: self.show_frames())
        self.mesh.on_update(lambda _: self.draw_mesh())
        add.on_click(self.add_to_path)
        play.on_click(self.play)
        keep.on_click(self.save_path)
        clear.on_click(lambda _: self.clear_path())
        save.on_click(self.save_picture)

    def add_frames(self) -> None:
        """Source cameras as frusta with their pictures."""
        self.frusta = []
        for number, frame in enumerate(self.contents.frames):
            camera = frame.camera
            self.frusta.append(
                self.server.scene.add_camera_frustum(
                    f"/cameras/{number}",
                    fov=2 * np.arctan(camera.height / (2 * camera.fy)),
                    aspect=camera.width / camera.height,
                    scale=max(25 * self.spacing, 1e-3),
                    image=shrink(frame.color),
                    wxyz=wxyz(camera),
                    position=camera.world_from_cam[:3, 3],
                )
            )

    def show_frames(self) -> None:
        """Frusta on or off."""
        for frustum in self.frusta:
            frustum.visible = self.cameras.value

    def draw_points(self) -> None:
        """The clouds as the controls say."""
        with self.changing:
            for name, cloud in self.clouds.items():
                kept = select_points(cloud, cloud.confidence >= self.least.value) if self.least.value > 0 else cloud
                self.server.scene.add_point_cloud(
                    f"/points/{name}",
                    kept.points.astype(np.float32),
                    colors(kept, COLORS[self.by.value]),
                    point_size=self.size.value * self.spacing,
                    point_shape="square",
                    point_shading="flat",
                    precision="float32",
                    visible=self.shown[name].value,
                )

    def draw_mesh(self) -> None:
        """The scene as triangles, made when first asked for; removed objects left out."""
        import trimesh  # viser needs it too

        if self.contents.scene is None:
            return
        with self.changing:
            if not self.mesh.value:
                self.server.scene.remove_by_name("/mesh")
                return
            mesh = scene_mesh(self.contents.scene, objects=False)
            triangles = trimesh.Trimesh(mesh.vertices, mesh.triangles, vertex_colors=mesh.color, process=False)
            self.server.scene.add_mesh_trimesh("/mesh", triangles)

    def greet(self, client: Any) -> None:
        """A new visitor begins behind the first camera, a little to its side, or where all points are seen."""
        camera = self.contents.frames[0].camera if self.contents.frames else overview(self.contents)
        ahead = min(float(np.median(self.distances(camera))), FARTHEST_M)
        if self.contents.frames:
            camera = dolly(orbit(camera, yaw=ASIDE[0], pitch=ASIDE[1], pivot=ahead), -BEHIND * ahead)
        go_to(client, camera, look_ahead=ahead)

    def distances(self, camera: Camera) -> np.ndarray:
        """From a camera to a sample of the points, metres."""
        cloud = concatenate(list(sample_points(self.clouds, 5000).values()))
        return np.linalg.norm(cloud.points - camera.world_from_cam[:3, 3], axis=1)

    def add_to_path(self, event: Any) -> None:
        """The visitor's view becomes the path's next camera."""
        self.path.append(camera_of(event.client))
        self.draw_path()

    def clear_path(self) -> None:
        """No path."""
        self.path.clear()
        self.draw_path()

    def draw_path(self) -> None:
        """The path as a line through its cameras."""
        self.server.scene.remove_by_name("/path")
        if len(self.path) > 1:
            places = [
                camera_on_path(self.path, at).world_from_cam[:3, 3] for at in np.linspace(0, len(self.path) - 1, 100)
            ]
            segments = np.stack([places[:-1], places[1:]], axis=1).astype(np.float32)
            self.server.scene.add_line_segments(
                "/path", segments, (240, 228, 66), thickness=2.0, thickness_units="screen"
            )

    def play(self, event: Any) -> None:
        """The visitor is taken along the path."""
        if len(self.path) < 2:
            show_note(
                event.client, "A path needs two views", "Move somewhere and press 'Add this view', twice at least."
            )
            return
        pause = threading.Event()
        steps = round((len(self.path) - 1) * SECONDS_PER_CAMERA * STEPS_PER_SECOND)
        for at in np.linspace(0, len(self.path) - 1, steps + 1):
            camera = camera_on_path(self.path, float(at))
            go_to(event.client, camera, look_ahead=1.0)
            pause.wait(1 / STEPS_PER_SECOND)

    def save_path(self, event: Any) -> None:
        """The cameras of the path as a file that `dlama sequence --views` and `dlama video --path` read."""
        if not self.path:
            show_note(event.client, "There is no path yet", "Move somewhere and press 'Add this view'.")
            return
        cameras = [{"name": f"{number:03d}", **camera_as_json(each)} for number, each in enumerate(self.path)]
        event.client.send_file_download(
            "cameras.json", (json.dumps(cameras, indent=1) + "\n").encode(), save_immediately=True
        )

    def save_picture(self, event: Any) -> None:
        """What our renderer sees from here, as a PNG."""
        picture = render_contents(self.contents, camera_of(event.client))
        buffer = io.BytesIO()
        Image.fromarray(picture).save(buffer, "PNG")
        event.client.send_file_download("dlama.png", buffer.getvalue(), save_immediately=True)


def render_contents(contents: Contents, camera: Camera) -> UInt8Array:
    """H x W x 3: the scene as a surface, or where there is none its points, from a camera."""
    if contents.scene is not None:
        return render(contents.scene, camera).color
    return render(concatenate(list(contents.clouds.values())), camera, mode="points").color


def show_note(client: Any, title: str, body: str) -> None:
    """A note that goes away by itself."""
    client.add_notification(title, body, auto_close_seconds=4.0)


def typical_spacing(contents: Contents) -> float:
    """Metres between neighbouring points: a pixel at the median distance, else a share of the cloud's extent."""
    points = concatenate(list(contents.clouds.values())).points
    if contents.frames:
        camera = contents.frames[0].camera
        return float(np.median(np.linalg.norm(points - camera.world_from_cam[:3, 3], axis=1))) / camera.fx
    low, high = np.percentile(points, (2, 98), axis=0)
    return max(float(np.max(high - low)) / 1000, 1e-6)


def shrink(picture: UInt8Array) -> UInt8Array:
    """A picture with no side over FRAME_PICTURE."""
    image = Image.fromarray(np.ascontiguousarray(picture))
    image.thumbnail((FRAME_PICTURE, FRAME_PICTURE))
    return np.asarray(image)
