"""Which weights exist, where they lie, and how they come there; and an ONNX file, opened to run.

records   the catalogue: name -> urls, sha256, licence, contract
cache     a name -> the file on this disk
verify    a file on this disk -> whether it is the one the record means
pull      a record -> its file, downloaded, checked and moved into place
contracts   what a network takes and gives, in the metadata of its file
perceptron   a small npz file that ships, rows of features -> outputs
network_file   an ONNX file -> arrays in, arrays out, by ONNX Runtime
"""
