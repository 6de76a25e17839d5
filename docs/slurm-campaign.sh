#!/bin/sh
# A campaign as a Slurm job array: sbatch --array=0-15 docs/slurm-campaign.sh
#
# Every task flies one part into the folder `parts` on the shared file system. A task that is killed or requeued goes on where it was;
# one that is complete says so and ends. When all are there, on any machine: tumble campaign merge parts --out campaign
# Choose the number of parts so that one takes minutes, not seconds: many sites limit how many tasks may start in a minute.
#SBATCH --job-name=tumble-campaign
#SBATCH --requeue
#SBATCH --cpus-per-task=4
#SBATCH --time=02:00:00
#SBATCH --output=tumble-%A-%a.log
set -u

TUMBLE=${TUMBLE:-tumble}
PARTS=${PARTS:-parts}
COUNT=${SLURM_ARRAY_TASK_COUNT:?start this with sbatch --array=0-15}

"$TUMBLE" campaign iss-cargo granite-cargo --missions 1000 --draw \
    --jobs "${SLURM_CPUS_PER_TASK:-1}" --shard "$SLURM_ARRAY_TASK_ID/$COUNT" --out "$PARTS"
status=$?

# 3 says that a mission did not end well, which the table shows; the part is complete all the same.
if [ "$status" -eq 3 ]; then exit 0; fi
exit "$status"
