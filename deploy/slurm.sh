#!/bin/sh
# A field on SLURM: each task of an array job is a slice (docs/deploy.md). The launcher runs first, on a host that all reach:
#
#   trackfield certificates zhai-spcpf --out certificates --host HOST --slices 8
#   trackfield run zhai-spcpf --field external --listen tls/0.0.0.0:7447 --secure --certificates certificates --wait 3600
#   sbatch --array=1-8 deploy/slurm.sh tls/HOST:7447 certificates/guest
#
#SBATCH --job-name=trackfield
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=2
#SBATCH --mem=4G
#SBATCH --output=slice-%a.log
set -eu
connect=${1:?where does the router listen? like tls/10.0.0.1:7447} certificates=${2:-}
task=${SLURM_ARRAY_TASK_ID:?is not set; expected an array job: sbatch --array=1-8}

# Any range will do, such as 0-7, 1-8 or 10-80:10.
index=$(((task - SLURM_ARRAY_TASK_MIN) / SLURM_ARRAY_TASK_STEP))
slice=$index/$SLURM_ARRAY_TASK_COUNT

exec srun --ntasks=1 trackfield field --slice "$slice" --connect "$connect" --wait \
    --out "slice-$index-of-$SLURM_ARRAY_TASK_COUNT" ${certificates:+--secure "$certificates"}
