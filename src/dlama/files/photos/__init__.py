"""The photo of a phone in; the depth that its file carries, where there is any, out. Begin with `depth`."""
