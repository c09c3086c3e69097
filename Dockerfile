# Debian 13 with the packages of packages.txt and the repository; in it the commands of README.md
# work as they are, with the python3 of the image.
#
#   docker build -t ufl_origami .
#   docker run --rm --ipc host ufl_origami ./run test
FROM debian:trixie-slim

COPY packages.txt /ufl_origami/
RUN apt-get update \
    && sed 's/#.*//' /ufl_origami/packages.txt \
    | DEBIAN_FRONTEND=noninteractive xargs apt-get install -y --no-install-recommends \
    && rm -rf /var/lib/apt/lists/*

WORKDIR /ufl_origami
COPY . .
RUN python3 launcher/smoke.py && ./run bash launcher/ruff.sh

CMD ["./run"]
