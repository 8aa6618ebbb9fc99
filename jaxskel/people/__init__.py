"""Several people in one room: each becomes a recording of their own, which knows what the others hide.

In: a recording for each person (instance masks), or one in which all people are one mask. Out: a recording for each
person, and the poses of each. The paper treats one person only.
"""

from ._hidden import everybody as everybody
from ._hidden import hide_others as hide_others
from ._reconstruct_people import reconstruct_people as reconstruct_people
from ._tell_apart import MOST_PEOPLE as MOST_PEOPLE
from ._tell_apart import tell_people_apart as tell_people_apart
