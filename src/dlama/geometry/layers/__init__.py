"""A scene in; the layers and meshes that let it be seen from all cameras of a head box, in few triangles, out."""
