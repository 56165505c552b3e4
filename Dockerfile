# The page of dlama in a container. UNTRIED as an image, for no builder was at hand; its steps have been run outside of one.
#
#   docker build -t dlama .
#   docker run --rm --read-only --tmpfs /tmp --cap-drop ALL --security-opt no-new-privileges -p 127.0.0.1:7860:7860 dlama
#
# Kernels are compiled while the image is built. A file system that is read-only cannot keep numba's cache, so each start copies
# it to /tmp. The address with its token is printed at the start. Any other verb runs as `docker run ... dlama view ...`.
FROM python:3.11-slim AS build
COPY . /src
RUN pip install --no-cache-dir --prefix /opt/dlama /src

FROM python:3.11-slim
COPY --from=build /opt/dlama /usr/local
RUN useradd --create-home --uid 10001 dlama && mkdir /opt/kernels && chown dlama /opt/kernels
USER dlama
WORKDIR /tmp
RUN NUMBA_CACHE_DIR=/opt/kernels dlama warm-up
ENV NUMBA_CACHE_DIR=/tmp/kernels HOME=/tmp PYTHONDONTWRITEBYTECODE=1
EXPOSE 7860
ENTRYPOINT ["sh", "-c", "cp -rp /opt/kernels /tmp/kernels && exec dlama \"$@\"", "dlama"]
CMD ["serve", "--host", "0.0.0.0"]
