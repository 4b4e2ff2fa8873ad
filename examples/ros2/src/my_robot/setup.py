from glob import glob

from setuptools import find_packages, setup

package_name = "my_robot"

setup(
    name=package_name,
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/" + package_name]),
        ("share/" + package_name, ["package.xml"]),
        ("share/" + package_name + "/launch", glob("launch/*.launch.py")),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The sim-action developers",
    maintainer_email="sim-action@users.noreply.github.com",
    description="Nodes that drive a robot on wheels: a distance, along walls, and to a goal.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "mover = my_robot.mover:main",
            "wall_follower = my_robot.wall_follower:main",
            "planner = my_robot.planner:main",
            "smoother = my_robot.smoother:main",
        ]
    },
)
