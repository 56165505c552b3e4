"""EasySynth folders (Unreal Engine) in; frames and the cases of all three protocols out, and folders written back.

Begin with `dataset`; `listing` finds the files, `text_files` reads poses and classes, `frames` reads pictures.
"""
