//Maya ASCII 2024 scene
requires maya "2024";
currentUnit -l centimeter -a degree -t film;
createNode transform -n "head";
createNode mesh -n "headShape" -p "head";
	setAttr -s 2 ".iog[0].og";
	setAttr ".iog[0].og[0].gcl" -type "componentList" 1 "f[0]";
	setAttr ".iog[0].og[1].gcl" -type "componentList" 2 "f[1]" "f[1:90]";
	setAttr ".cuvs" -type "string" "second";
	setAttr ".op" yes;
	setAttr -s 6 ".vt[0:2]" 0 0 0 2 0 0 2 2 0;
	setAttr ".vt[3:5]" 0 2 0 4 0 0 4 2 0;
	setAttr -s 7 ".ed[0:6]" 0 1 0 1 2 0 2 3 1 3 0 0 1 4 0 4 5 0 5 2 0;
	setAttr ".uvst[0].uvsn" -type "string" "map1";
	setAttr -s 2 ".uvst[0].uvsp[0:1]" -type "float2" 0 0 1 1;
	setAttr ".uvst[1].uvsn" -type "string" "second";
	setAttr -s 6 ".uvst[1].uvsp[0:5]" -type "float2" 0 0 1 0 1 1 0 1 2 0 2 1;
	setAttr -s 2 ".fc[0:1]" -type "polyFaces"
		f 4 0 1 2 3
		mu 0 4 0 1 1 0
		mu 1 4 0 1 2 3
		mc 0 4 0 1 2 3
		h 3 0 1 2
		f 4 4 5 6 -2
		mu 1 4 1 4 5 2
		fc 4 0 1 2 3;
	setAttr ".pt[0]" -type "float3" 0 0 1;
createNode shadingEngine -n "skinSG";
createNode shadingEngine -n "teethSG";
connectAttr "headShape.iog.og[0]" "teethSG.dsm" -na;
connectAttr "headShape.iog[0].og[0]" "skinSG.dsm" -na;
connectAttr "headShape.iog[0].og[1]" "teethSG.dsm" -na;
createNode transform -n "other";
parent -s -nc -r -add "|head|headShape" "other";
createNode displayLayer -n "layer";
	setAttr ".v" no;
createNode transform -n "hidden";
	setAttr ".v" no;
createNode mesh -n "hiddenShape" -p "hidden";
	setAttr ".v" no;
	setAttr -s 3 ".vt[0:2]" 0 0 0 1 0 0 0 1 0;
	setAttr -s 3 ".ed[0:2]" 0 1 0 1 2 0 2 0 0;
	setAttr ".fc[0]" -type "polyFaces" f 3 0 1 2;
connectAttr "layer.di" "hidden.do";
createNode transform -n "detail";
	setAttr ".lodv" no;
	setAttr ".ove" yes;
	setAttr ".ovv" no;
createNode mesh -n "emptyShape" -p "other";
createNode mesh -n "wrongShape" -p "other";
	setAttr -s 2 ".vt[0:1]" 0 0 0 1 1 1;
	setAttr ".ed[0]" 0 9 0;
	setAttr ".fc[0]" -type "polyFaces" f 3 0 0 0;
createNode mesh -n "edgesShape" -p "other";
	setAttr -s 2 ".vt[0:1]" 0 0 0 1 1 1;
	setAttr ".ed[0]" 0 1 0;
	setAttr ".fc[0]" -type "polyFaces" f 3 0 1 2;
createNode mesh -n "pointsShape" -p "other";
	setAttr -s 2 ".vt[0:1]" 0 0 0 1 1 1;
