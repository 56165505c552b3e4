"""Object masks: a picture (with depth) and clicks or a box in; which pixels are the object meant out.

Begin with `prompt` (what a user points at), then `rgbd` (depth; `confirmed` and `outlines` where a camera measured it).
`dlama.perception.object_masks` chooses among them.
"""
