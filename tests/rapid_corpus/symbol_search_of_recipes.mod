! @run 0.5
! @line rec_bolt 8 45
! @line rec_nut 6 20
! @line 2 recipes
! @line changed: 99
! @line num data: 3
MODULE RecipeBook
    RECORD recipe
        num size;
        num torque;
    ENDRECORD
    PERS recipe rec_bolt:=[8,45];
    PERS recipe rec_nut:=[6,20];
    PERS num rec_no:=7;
    VAR num first:=1;
    VAR num second:=2;
    PROC main()
        VAR datapos block;
        VAR string name;
        VAR recipe found;
        VAR num count;
        VAR num n;
        SetDataSearch "recipe"\Object:="rec_.*"\PersSym\GlobalSym;
        WHILE GetNextSym(name,block\Recursive) DO
            GetDataVal name\Block:=block,found;
            TPWrite name+" "+ValToStr(found.size)+" "+ValToStr(found.torque);
            Incr count;
        ENDWHILE
        TPWrite ValToStr(count)+" recipes";
        found.torque:=99;
        SetDataVal "rec_nut",found;
        TPWrite "changed: "+ValToStr(rec_nut.torque);
        count:=0;
        SetDataSearch "num"\InMod:="RecipeBook";
        WHILE GetNextSym(name,block) DO
            Incr count;
        ENDWHILE
        TPWrite "num data: "+ValToStr(count);
        Stop;
    ENDPROC
ENDMODULE
