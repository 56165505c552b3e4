"""A scene, a cloud, results or a data set in; a 3-D page in the browser out (viser). Begin with `contents`, then `server`."""
